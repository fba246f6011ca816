"""Conjugate gradients, preconditioned by a multigrid cycle, for the normal equations of lattice regression."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.compiled import compiled
from lutforge.errors import CalibrationError
from lutforge.solvers.multigrid import Multigrid
from lutforge.solvers.stencil import REASSOCIATED, from_planar, planar
from lutforge.threads import run

Array = NDArray[np.float64]

MOST = 200
FAILED = 1000.0
"""A residual this many times the goal, after MOST iterations, is no solution."""


def solve(
    multigrid: Multigrid,
    right: Array,
    start: Array,
    tolerance: float,
    extra: Callable[[Array], Array] | None = None,
    most: int = MOST,
) -> tuple[Array, int]:
    """Solve (A + extra) b = right for the three outputs together.

    right, start: (N_r, N_g, N_b, 3); tolerance: relative residual per output; extra: a further term of the operator, of
    such lattices. Returns b and the iterations used.
    Raises CalibrationError where `most` iterations do not reach the tolerance within a factor of FAILED.
    """
    b, residual = planar(start), planar(right)
    direction, image = np.zeros_like(b), np.empty_like(b)

    def apply(lattice: Array) -> None:
        multigrid.product(lattice, image)
        if extra:
            image[:] += planar(extra(from_planar(lattice, multigrid.size)))

    goal = tolerance * np.sqrt(np.maximum(np.einsum("ijkc,ijkc->c", right, right), 1e-300))
    if np.any(b):
        apply(b)
        residual -= image
    size, rho = np.sqrt(np.einsum("cp,cp->c", residual, residual)), np.zeros(3)
    for iteration in range(most):
        if np.all(size <= goal):
            return from_planar(b, multigrid.size), iteration
        multigrid.right[:] = residual
        multigrid.cycle()
        run(lambda first, last: _turn(residual, multigrid.b, rho, direction, first, last), multigrid.outputs)
        apply(direction)
        run(lambda first, last: _advance(direction, image, rho, b, residual, size, first, last), multigrid.outputs)
    if np.any(size > FAILED * goal):
        raise CalibrationError(
            f"lattice regression: {most} iterations left a residual of {np.max(size / goal) * tolerance:.1g}; "
            "the samples cover too little of colour space for this size: use a smaller --size"
        )
    return from_planar(b, multigrid.size), most


@compiled(fastmath=REASSOCIATED)
def _turn(
    residual: Array, preconditioned: NDArray[np.floating[Any]], rho: Array, direction: Array, first: int, last: int
) -> None:
    """The next direction, conjugate to those before; rho: residual · preconditioned, (3,)."""
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
    """One step along the direction; size: the norm of the residual that it leaves, (3,)."""
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
