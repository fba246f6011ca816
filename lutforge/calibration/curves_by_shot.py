"""How much better a response curve for each shot predicts exposure pairs than one common curve does.

Where f is a fixed property of the camera, curves of single shots fit noise, and predict surfaces that were left out no
better. Errors of the shutter, and a deviation of f that all shots share, belong to the common curve. The noise is that
of the pairs, whatever its cause: quantization, compression, or a gamut map that changes some colours.
"""

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.model.response import Response
from lutforge.solvers.cross_validation import leave_groups_out
from lutforge.solvers.robust_weights import RobustWeights, cauchy

MOST_PAIRS = 5000
"""Pairs that are used at most, chosen at random."""
LEAST_SURFACES = 5
"""Surfaces from which on some can be left out."""
COMMON_WAVES, SHOT_WAVES = 6, 2
"""Sines of a deviation of f that all shots share, and of one of a single shot."""
HIGHEST_PREDICTED = 0.98
"""Pairs whose second value is predicted above this are left out: it may be clipped."""
LEAST_INVERSE_SLOPE = 1e-3
"""Slope of f⁻¹ at least, so that black has a slope."""
DEPENDENT = 1e-6
"""Terms whose squares differ by this share are nearly dependent."""


def share_explained_by_shots(pairs: ExposurePairs, response: Response, rows: Mask) -> float:
    """The share of the variance of left-out pairs that a curve per shot explains beyond a common curve.

    rows: mask (n,) of the pairs to use. The share is negative where the curves fit noise, and 0 with too few surfaces.
    """
    rows = rows.copy()
    rows[np.random.default_rng(0).permutation(np.flatnonzero(rows))[MOST_PAIRS:]] = False
    chosen = pairs.select(rows)
    surfaces = np.char.mod("%d", chosen.first_row)
    if len(np.unique(surfaces)) < LEAST_SURFACES:
        return 0.0

    common, by_shot, residuals = _terms(chosen, response)
    residuals_of_common = residuals - common @ _solution(common, residuals)
    weight = np.sqrt(RobustWeights(cauchy, multiple=3, least=DEPENDENT)(np.abs(residuals_of_common)))

    # Residuals of left-out surfaces, by the common terms alone and by all terms.
    left_out = np.zeros((2, len(residuals)))
    for fold in leave_groups_out(np.repeat(surfaces, 3)):
        for row, terms in zip(left_out, (common, np.hstack([common, by_shot])), strict=True):
            coefficients = _solution((weight[:, None] * terms)[~fold], (weight * residuals)[~fold])
            row[fold] = (weight * (residuals - terms @ coefficients))[fold]
    by_common, by_all = np.sum(left_out**2, axis=1)
    return float(1.0 - by_all / max(by_common, DEPENDENT**2))


def _terms(pairs: ExposurePairs, response: Response) -> tuple[Array, Array, Array]:
    """Terms of what all shots share (3 n, p), terms of single shots (3 n, q), and the residuals of pairs (3 n,).

    Let the responses of two shots deviate from f by δ and δ'. Then I' − τ(I) changes by δ'(I') − τ'(I) δ(I), where τ'
    is the slope of the brightness transfer function. δ of a single shot is a sum of sin πI and sin 2πI: they describe a
    gamma, raised shadows, lowered highlights and a contrast. The shared deviation is a sum up to sin 6πI, and has
    one more term for the error of each shutter. Each row is scaled to the noise of one JPEG value.
    """
    first = pairs.first
    second = pairs.second
    ratio = np.exp(pairs.log_ratio)[:, None]
    linear = ratio * response.linearize(first)
    expected = response.encode(linear)

    # The slope of τ is k (f⁻¹)'(I) / (f⁻¹)'(τ(I)).
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    inverse_slope = np.maximum(np.gradient(response.inverse, codes, axis=0), LEAST_INVERSE_SLOPE)
    slope_first, slope_expected = (
        np.stack([np.interp(values[:, c], codes, inverse_slope[:, c]) for c in range(3)], axis=1)
        for values in (first, expected)
    )
    slope = ratio * slope_first / slope_expected
    is_low = np.all(expected < HIGHEST_PREDICTED, axis=1)[:, None]
    scale = np.where(is_low, 1.0 / np.hypot(1.0, slope), 0.0)

    # A column for each sine and channel, each shutter, and each sine of each shot.
    waves = [(np.sin(j * np.pi * second), slope * np.sin(j * np.pi * first)) for j in range(1, COMMON_WAVES + 1)]
    shots = np.arange(len(pairs.shots))[:, None, None]
    is_first = pairs.first_shot[:, None] == shots
    is_second = pairs.second_shot[:, None] == shots
    common = [np.eye(3)[:, None, :] * (of_second - of_first) for of_second, of_first in waves]
    shutters = (is_second * 1.0 - is_first) * linear / slope_expected
    by_shot = [is_second * of_second - is_first * of_first for of_second, of_first in waves[:SHOT_WAVES]]

    columns = [np.concatenate(parts) * scale for parts in ([*common, shutters], by_shot)]
    shared, single = (column.reshape(len(column), -1).T for column in columns)
    return shared, single, ((second - expected) * scale).ravel()


def _solution(terms: Array, values: Array) -> Array:
    """The least-squares solution of least norm; terms that are nearly dependent get no weight."""
    return np.asarray(np.linalg.pinv(terms.T @ terms, rcond=DEPENDENT, hermitian=True) @ (terms.T @ values))
