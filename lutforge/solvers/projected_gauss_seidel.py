"""Lattice regression with every node in bounds, by projected Gauss-Seidel.

A sweep moves each node to the least of the objective along it, cut to the bounds; that converges to the bounded minimum
for every symmetric positive definite operator (Cryer, SIAM J. Control 9, 1971). It carries little further than from
neighbour to neighbour, so the start has to be right at large: a prior, or the fit at other node levels.
"""

import numpy as np

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import Levels
from lutforge.solvers.coarsening import coarsen_axis
from lutforge.solvers.lattice_regression import LatticeFit, Prior
from lutforge.solvers.normal_equations import NormalEquations
from lutforge.solvers.solution import Status
from lutforge.solvers.stencil import COUPLINGS, FAR, couple, from_planar, planar, steps


def solve_bounded(
    equations: NormalEquations,
    levels: Levels,
    smoothness: float,
    prior: Prior,
    start: Array,
    bounds: tuple[float, float],
    sweeps: int,
) -> LatticeFit:
    """Fit node values (N_r, N_g, N_b, 3) within bounds, from W'ΩW and W'Ω(y − W b₀).

    smoothness: λ_S, and λ_T; prior: b₀ and Λ²; start: node values to begin with. Time O(N³) a sweep, forward and back
    in turn. Their number is fixed; the residual is how far the last one moved a node, and the fit has converged where
    that is within a quarter of a code.
    """
    r, g, b = (len(axis) for axis in levels)
    longest, size = max(r, g, b), (r, g, b)
    bends, slopes, masses = np.zeros((3, longest, 3)), np.zeros((3, longest, 3)), np.zeros((3, longest))
    none = np.zeros((0, 3, longest), dtype=np.int64), np.zeros((0, 3, 2, longest), dtype=np.float32)
    for axis, nodes in enumerate(levels):
        coarsen_axis(nodes, axis, *none, bends[None], slopes[None], masses[None])
    couplings = np.zeros((COUPLINGS, (r + FAR) * g * b))
    diagonal = np.moveaxis(prior.weight, 3, 0).reshape(3, -1).copy()
    couple(equations.stencil, bends, slopes, masses, smoothness, smoothness, couplings, diagonal)
    difference = planar(np.clip(start, *bounds) - prior.values)
    offset, right = planar(prior.values), planar(equations.right)
    moved = _sweep(couplings, diagonal, steps(g, b), FAR * g * b, right, offset, *bounds, sweeps, difference)
    values = np.clip(prior.values + from_planar(difference, size), *bounds)  # what rounding leaves beyond
    status = Status.CONVERGED if moved <= 1e-3 else Status.LIMIT
    return LatticeFit(levels, values, status, moved, sweeps)


@compiled(fastmath={"contract"})
def _sweep(
    couplings: Array,
    diagonal: Array,
    far: Index,
    margin: int,
    right: Array,
    offset: Array,
    lowest: float,
    highest: float,
    sweeps: int,
    b: Array,
) -> float:
    """Solve A b = right in place, lowest ≤ offset + b ≤ highest, and return how far the last sweep moved a node.

    Lattices are planar, with `margin` nodes before the first.
    """
    nodes, moved = diagonal.shape[1], 0.0
    b0, b1, b2 = b
    for sweep in range(sweeps):
        for step in range(nodes):
            node = nodes - 1 - step if sweep % 2 else step
            p = margin + node
            r0, r1, r2 = right[0, p], right[1, p], right[2, p]
            for t in range(COUPLINGS):
                after, before = np.uint64(p + far[t]), np.uint64(p - far[t])  # unsigned: no test for the end's count
                ahead, behind = couplings[t, np.uint64(p)], couplings[t, before]
                r0 -= ahead * b0[after] + behind * b0[before]
                r1 -= ahead * b1[after] + behind * b1[before]
                r2 -= ahead * b2[after] + behind * b2[before]
            old0, old1, old2 = b0[p], b1[p], b2[p]
            b0[p] = min(max(r0 / diagonal[0, node], lowest - offset[0, p]), highest - offset[0, p])
            b1[p] = min(max(r1 / diagonal[1, node], lowest - offset[1, p]), highest - offset[1, p])
            b2[p] = min(max(r2 / diagonal[2, node], lowest - offset[2, p]), highest - offset[2, p])
            if sweep == sweeps - 1:
                moved = max(moved, abs(b0[p] - old0), abs(b1[p] - old1), abs(b2[p] - old2))
    return moved
