"""Preconditioned conjugate gradients for several right-hand sides at once.

Hestenes & Stiefel 1952; Saad, "Iterative Methods for Sparse Linear Systems", 2003, algorithm 9.1.
"""

from functools import partial
from typing import Protocol

import numpy as np

from lutforge.arrays import Array, Real
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.solvers.solution import Solution, Status
from lutforge.threads import run, slabs


class Operator(Protocol):
    """A symmetric positive definite operator A for each of c systems, and a preconditioner M ≈ A⁻¹, as symmetric."""

    @property
    def threads(self) -> int:
        """The number of threads that is fastest for vectors of this length."""

    def product(self, b: Array, out: Array) -> None:
        """Fill out with A b; both (c, n)."""

    def precondition(self, residual: Array) -> Real:
        """M residual, (c, n), which may be overwritten by the next call."""


def conjugate_gradients(
    operator: Operator, right: Array, start: Array | None = None, *, tolerance: float, most: int = 200
) -> Solution:
    """Solve A b = right, each row of (c, n) a system of its own, from `start`, or from 0.

    tolerance: norm of the residual relative to that of the right-hand side, for every system; most: iterations at most.
    The solution's residual is that ratio, the largest of all systems.
    """
    b, residual = np.zeros_like(right), right.copy()
    direction, image = np.zeros_like(right), np.empty_like(right)
    if start is not None and np.any(start):
        b[:] = start
        operator.product(b, image)
        residual -= image
    count, parts = len(right), slabs(0, len(right), 1, operator.threads)
    scale = np.sqrt(np.maximum(np.einsum("cp,cp->c", right, right), 1e-300))
    size, rho = np.sqrt(np.einsum("cp,cp->c", residual, residual)), np.zeros(count)
    iteration = 0
    while iteration < most and np.any(size > tolerance * scale):
        run(partial(_turn, residual, operator.precondition(residual), rho, direction), parts)
        operator.product(direction, image)
        run(partial(_advance, direction, image, rho, b, residual, size), parts)
        iteration += 1
    reached = float(np.max(size / scale))
    if not np.isfinite(reached):
        return Solution(b, Status.SINGULAR, reached, iteration)
    return Solution(b, Status.CONVERGED if reached <= tolerance else Status.LIMIT, reached, iteration)


@compiled(fastmath=REASSOCIATED)
def _turn(residual: Array, preconditioned: Real, rho: Array, direction: Array, first: int, last: int) -> None:
    """Turn to the next direction, conjugate to those before; rho: residual · preconditioned, (c,)."""
    for c in range(first, last):
        r, z, d = residual[c], preconditioned[c], direction[c]
        total = 0.0
        for p in range(len(r)):
            total += r[p] * z[p]
        ratio = total / rho[c] if rho[c] > 0.0 else 0.0
        rho[c] = total
        for p in range(len(r)):
            d[p] = z[p] + ratio * d[p]


@compiled(fastmath=REASSOCIATED)
def _advance(
    direction: Array, image: Array, rho: Array, b: Array, residual: Array, size: Array, first: int, last: int
) -> None:
    """Take one step along the direction; size: the norm of the residual that it leaves, (c,)."""
    for c in range(first, last):
        d, a, x, r = direction[c], image[c], b[c], residual[c]
        curvature = 0.0
        for p in range(len(d)):
            curvature += d[p] * a[p]
        step = rho[c] / curvature if curvature > 0.0 else 0.0
        total = 0.0
        for p in range(len(d)):
            x[p] += step * d[p]
            rest = r[p] - step * a[p]
            r[p] = rest
            total += rest * rest
        size[c] = np.sqrt(total)
