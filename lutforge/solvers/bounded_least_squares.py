"""Least squares with bounds, from the normal equations, by an active set (Kunisch & Rendl, SIAM J. Optim. 14, 2003).

Guess which bounds hold, solve for the rest, exchange all that are wrong: a few small Cholesky factorisations. Where
that goes round in circles, or the equations do not tell every unknown, SciPy's general solver takes over.
"""

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear

from lutforge.arrays import Array, Mask

MOST_EXCHANGES = 20
RANK_TOLERANCE = 1e-14
"""Eigenvalues below this share of the largest are rounding errors."""


def bounded_least_squares(normal: Array, right: Array, lower: Array, upper: Array, like: Array | None = None) -> Array:
    """u (k,) that minimises u'Nu − 2 r'u with lower ≤ u ≤ upper.

    normal: N (k, k), positive semidefinite; right: r (k,); lower, upper: (k,); like: the solution of a like problem,
    whose bounds are the first guess. Time O(k³) an exchange.
    """
    low = high = np.zeros(len(right), dtype=np.bool_)
    if like is not None:
        low, high = like <= lower, like >= upper
    for _ in range(MOST_EXCHANGES):
        held = low | high
        system, target = (normal, right) if not held.any() else _with_fixed(normal, right, held, lower, upper, low)
        _, u, singular = dposv(system, target)
        if singular:
            break
        below, above = u < lower, u > upper
        if held.any():  # those stay whose bound still holds u back
            slope = normal @ u - right
            below, above = np.where(low, slope > 0.0, below), np.where(high, slope < 0.0, above)
        if np.array_equal(below, low) and np.array_equal(above, high):
            return np.asarray(u)
        low, high = below, above
    values, vectors = np.linalg.eigh(normal)
    told = values > RANK_TOLERANCE * values[-1]
    root = np.sqrt(values[told])[:, None]
    return np.asarray(
        lsq_linear(root * vectors[:, told].T, (vectors[:, told].T @ right) / root[:, 0], (lower, upper)).x
    )


def _with_fixed(normal: Array, right: Array, held: Mask, lower: Array, upper: Array, low: Mask) -> tuple[Array, Array]:
    """The equations with the held unknowns at their bounds: the lower one where low, else the upper."""
    at = np.where(low, lower, upper)
    at[~held] = 0.0
    system, target = normal.copy(), right - normal @ at
    system[held], system[:, held] = 0.0, 0.0
    system[held, held], target[held] = 1.0, at[held]
    return system, target
