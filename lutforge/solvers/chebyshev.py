"""The smoother of the multigrid cycle: Chebyshev polynomials of the fourth kind over l1-Jacobi.

A polynomial in A takes only products with A, which vectorize and run in parallel; that of the fourth kind needs no
lower bound of the spectrum, and the l1 scaling makes its upper bound 1 for every A. Two steps before and two after the
coarse correction smooth as well as a symmetric Gauss-Seidel sweep. Lottes, "Optimal polynomial smoothers for multigrid
V-cycles", Numerical Linear Algebra with Applications 30 (2023), algorithm 3 and its table of β; Baker, Falgout, Kolev &
Yang, "Multigrid smoothers for ultraparallel computing", SIAM J. Sci. Comput. 33 (2011).
"""

import numpy as np

from lutforge.arrays import Real
from lutforge.compiled import compiled
from lutforge.solvers.stencil import FAR, run_planes


@compiled(fastmath={"contract"})
def first_step(damping: Real, residual: Real, plane: int, correction: Real, b: Real, first: int, last: int) -> None:
    """Add the first correction of the polynomial to b, on planes first … last − 1.

    first is a multiple of run_planes(plane).

    residual, correction, b: (3, nodes and FAR planes on both sides).
    """
    planes, factor, optimal = run_planes(plane), np.float32(4 / 3), np.float32(1.02387287570313)
    for begin in range(first, last, planes):
        node, count = begin * plane, (min(begin + planes, last) - begin) * plane
        start = node + FAR * plane
        for c in range(3):
            scale, r = damping[c, node : node + count], residual[c, start : start + count]
            z, x = correction[c, start : start + count], b[c, start : start + count]
            for p in range(count):
                z[p] = factor * scale[p] * r[p]
                x[p] += optimal * z[p]


@compiled(fastmath={"contract"})
def second_step(damping: Real, residual: Real, plane: int, correction: Real, b: Real, first: int, last: int) -> None:
    """Add the second correction, from the residual that the first one left."""
    planes, kept, new, optimal = run_planes(plane), np.float32(1 / 5), np.float32(12 / 5), np.float32(1.26408905371085)
    for begin in range(first, last, planes):
        node, count = begin * plane, (min(begin + planes, last) - begin) * plane
        start = node + FAR * plane
        for c in range(3):
            scale, r = damping[c, node : node + count], residual[c, start : start + count]
            z, x = correction[c, start : start + count], b[c, start : start + count]
            for p in range(count):
                x[p] += optimal * (kept * z[p] + new * scale[p] * r[p])
