"""Tests whether all shots have one response, by how much better a curve per shot predicts surfaces that were left out.

Errors of the shutter, and another f that all shots share, do not count as a departure of single shots. The remaining
departures are compared with the noise of the pairs, whatever its cause: quantization, compression, or a gamut map that
changes some colours.
"""

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.model.response import Response
from lutforge.solvers.cross_validation import leave_groups_out
from lutforge.solvers.robust_weights import RobustWeights, cauchy


def share_of_own_curves(pairs: ExposurePairs, response: Response, rows: Mask) -> float:
    """Return the share of the variance of left-out pairs that a curve per shot explains beyond a common curve.

    rows: mask (n,) of the pairs to use. The share is negative where the curves fit noise, and 0 with too few pairs.
    """
    rows = rows.copy()
    rows[np.random.default_rng(0).permutation(np.flatnonzero(rows))[5000:]] = False
    chosen = pairs.select(rows)
    surfaces = np.char.mod("%d", chosen.first_row)
    if len(np.unique(surfaces)) < 5:
        return 0.0
    common, own, departure = _terms(chosen, response)
    residual_of_common = departure - common @ _solution(common, departure)
    weight = np.sqrt(RobustWeights(cauchy, multiple=3.0, least=1e-6)(np.abs(residual_of_common)))
    residuals = np.zeros((2, len(departure)))
    for held in leave_groups_out(np.repeat(surfaces, 3)):
        for residual, terms in zip(residuals, (common, np.hstack([common, own])), strict=True):
            found = _solution((weight[:, None] * terms)[~held], (weight * departure)[~held])
            residual[held] = (weight * (departure - terms @ found))[held]
    without, with_own = np.sum(residuals**2, axis=1)
    return float(1.0 - with_own / max(without, 1e-12))


def _terms(pairs: ExposurePairs, response: Response) -> tuple[Array, Array, Array]:
    """Return terms of what shots share (3 n, p) and of single shots (3 n, q), and the departures of pairs (3 n,).

    Two shots that depart from f by δ and δ' change I' − τ(I) by δ'(I') − τ'(I) δ(I), where τ' is the slope of the
    brightness transfer function. δ of a single shot is a sum of sin πI and sin 2πI, which describe a gamma, lifted
    shadows, held highlights and a contrast. What shots share is a sum up to sin 6πI, and the errors of their shutters.
    Each row is scaled to the noise of one JPEG value.
    """
    first, second, ratio = pairs.first, pairs.second, np.exp(pairs.log_ratio)[:, None]
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    speed = np.maximum(np.gradient(response.inverse, codes, axis=0), 1e-3)
    light = ratio * response.linearize(first)
    expected = response.encode(light)
    before, after = (
        np.stack([np.interp(side[:, c], codes, speed[:, c]) for c in range(3)], axis=1) for side in (first, expected)
    )
    slope = ratio * before / after
    scale = np.where(np.all(expected < 0.98, axis=1)[:, None], 1.0 / np.hypot(1.0, slope), 0.0)
    shots = np.arange(len(pairs.shots))[:, None, None]
    is_first, is_second = pairs.first_shot[:, None] == shots, pairs.second_shot[:, None] == shots
    waves = [(np.sin(j * np.pi * second), slope * np.sin(j * np.pi * first)) for j in range(1, 7)]
    common = [np.eye(3)[:, None, :] * (there - here) for there, here in waves]
    shutters = (is_second * 1.0 - is_first) * light / after
    own = [is_second * there - is_first * here for there, here in waves[:2]]
    columns = [np.concatenate(parts) * scale for parts in ([*common, shutters], own)]
    shared, single = (column.reshape(len(column), -1).T for column in columns)
    return shared, single, ((second - expected) * scale).ravel()


def _solution(terms: Array, values: Array) -> Array:
    """The least-squares solution of least norm; terms that are nearly dependent get no weight."""
    return np.asarray(np.linalg.pinv(terms.T @ terms, rcond=1e-6, hermitian=True) @ (terms.T @ values))
