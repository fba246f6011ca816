"""The polynomial baselines of the thesis (Fig. 4.5): functions x (n, 3) → y (n, 3)."""

from collections.abc import Callable
from itertools import combinations_with_replacement

import numpy as np
from numpy.polynomial import Polynomial

from lutforge.arrays import Array

Predictor = Callable[[Array], Array]

ORDER = 6
"""The degree of the polynomial of each channel, as in the thesis."""
RIDGE = 1e-9
"""Weight of a squared coefficient, where a sample has 1: undetermined coefficients stay small."""


def channel_polynomials(x: Array, y: Array) -> Predictor:
    """Fit one polynomial per channel, x (n, 3) → y (n, 3). Inputs outside the range of x are clamped to it."""
    # With few tones the coefficients are not determined: `full` takes the smallest, without it NumPy warns.
    fits = [Polynomial.fit(x[:, c], y[:, c], ORDER, full=True)[0] for c in range(3)]
    low = x.min(axis=0)
    high = x.max(axis=0)

    def predict(values: Array) -> Array:
        inside = np.clip(values, low, high)
        return np.stack([np.asarray(fits[c](inside[:, c])) for c in range(3)], axis=1)

    return predict


def mixed_channel_polynomials(encoded: Array, raw: Array) -> Predictor:
    """Fit JPEG → RAW, E = M p(I): one polynomial per channel, then a 3 × 3 matrix (Chakrabarti et al. 2009).

    The curves and the matrix are fitted in turn by least squares. The start is the best fit with a curve of its own
    from each channel of the JPEG to each of the RAW; for each channel of the JPEG the coefficients of its three curves
    are then reduced to a matrix of rank one: one curve with three factors. All linear systems consist of sums of
    products of terms, which are computed from the samples once.
    """
    powers = np.arange(1, ORDER + 1)
    terms = encoded[:, :, None] ** powers  # (n, 3, ORDER)
    design = terms.reshape(len(encoded), -1)
    products = design.T @ design
    right_sides = (design.T @ raw).reshape(3, ORDER, 3)
    ridge = RIDGE * len(encoded) * np.eye(len(products))
    additive = np.linalg.solve(products + ridge, right_sides.reshape(-1, 3)).reshape(3, ORDER, 3)
    blocks = products.reshape(3, ORDER, 3, ORDER)
    left, strength, right = np.linalg.svd(additive)
    curves = left[:, :, 0] * strength[:, :1]  # (3, ORDER)
    matrix = right[:, 0, :].T  # (3, 3): column k takes channel k's curve
    for _ in range(30):
        joint = np.einsum("kplq,kl->kplq", blocks, matrix.T @ matrix).reshape(products.shape)
        right_side = np.einsum("kpc,ck->kp", right_sides, matrix).reshape(-1)
        curves = np.linalg.solve(joint + ridge, right_side).reshape(3, ORDER)
        normal = np.einsum("kp,kplq,lq->kl", curves, blocks, curves)
        matrix = np.linalg.lstsq(normal, np.einsum("kp,kpc->kc", curves, right_sides), rcond=None)[0].T
    low, high = encoded.min(axis=0), encoded.max(axis=0)

    def predict(values: Array) -> Array:
        inside = np.clip(values, low, high)[:, :, None] ** powers
        return np.asarray(np.einsum("nkp,kp->nk", inside, curves) @ matrix.T)

    return predict


def colour_polynomial(x: Array, y: Array) -> Predictor:
    """Fit one polynomial of all three channels.

    Its degree is 4 (35 terms), or the highest at which there are four samples for each term.
    """
    degree = 4
    while degree > 1 and len(x) < 4 * len(_terms(degree)):
        degree -= 1
    terms = _terms(degree)
    low, high = x.min(axis=0), x.max(axis=0)
    span = np.maximum(high - low, 1e-6)

    def design(values: Array) -> Array:
        unit = 2.0 * (np.clip(values, low, high) - low) / span - 1.0
        return np.stack([np.prod(unit[:, list(term)], axis=1) for term in terms], axis=1)

    matrix = design(x)
    normal = matrix.T @ matrix + RIDGE * len(x) * np.eye(len(terms))
    coefficients = np.asarray(np.linalg.solve(normal, matrix.T @ y), dtype=np.float64)
    return lambda values: np.asarray(design(values) @ coefficients)


def _terms(degree: int) -> list[tuple[int, ...]]:
    """The channel indices of every monomial up to a degree; () is the constant."""
    return [term for order in range(degree + 1) for term in combinations_with_replacement(range(3), order)]
