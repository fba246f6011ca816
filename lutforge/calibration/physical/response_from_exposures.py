"""The camera response f from exposure pairs (thesis 4.2.1): EMoR in the log domain (4.3, 4.4), or another basis.

Linear least squares under the inequalities that make f⁻¹ rise. The "thesis" preset trusts all colours below a
saturation β and no others; the "lutforge" preset starts there and then trusts each pair by its residual.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import Preset
from lutforge.calibration.physical.curve_basis import CurveBasis, log_emor_basis, solve_rising
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.calibration.physical.unsaturated import BETA, check_tones, saturation, starting_beta
from lutforge.model.emor import log_inverse_emor
from lutforge.model.response import Response
from lutforge.solvers.robust_weights import RobustWeights, geman_mcclure


@dataclass(frozen=True, eq=False)
class ExposureResponseFit:
    """f of one style from exposure pairs, f(1) = 1. shot_error: by shot, the log of true over stated exposure."""

    response: Response
    shot_error: dict[str, float]


def fit_response_to_exposures(
    pairs: ExposurePairs, preset: Preset = "lutforge", beta: float = BETA, basis: CurveBasis | None = None
) -> ExposureResponseFit:
    """Fit f to JPEG values of the same surfaces in differently exposed shots, and each shot's exposure error.

    basis: the curves that log f⁻¹ is one of; EMoR's 15 unless given.
    Raises CalibrationError where there are no pairs of unsaturated colours, or they span too few tones.
    """
    chroma = np.maximum(saturation(pairs.first), saturation(pairs.second))
    low = chroma < starting_beta(chroma, preset, beta)
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(low, 2))
    return _fit(pairs, low, preset, basis or log_emor_basis())


def fit_response_to_all_colours(pairs: ExposurePairs) -> ExposureResponseFit:
    """Fit f without the removal of outliers: the conventional way that the thesis compares with (Fig. 4.2, [24]).

    Raises CalibrationError as `fit_response_to_exposures`.
    """
    return fit_response_to_exposures(pairs, "thesis", beta=np.inf)


def _fit(pairs: ExposurePairs, low: Mask, preset: Preset, basis: CurveBasis) -> ExposureResponseFit:
    """f in one basis; low: (n,) the pairs to start from."""
    robust, pair_weights = preset == "lutforge", RobustWeights(geman_mcclure, multiple=3.0, least=1.0)
    weight, noise = low.astype(np.float64), np.full(pairs.first.shape, 0.02)
    for turn in range(1, 13 if robust else 4):
        logs, errors = _solve(pairs, basis, weight, noise, alike=robust)
        expected = _log_noise(pairs, logs)
        residual = np.max(np.abs(_pair_residual(pairs, logs, errors)) / expected, axis=1)
        noise = expected if robust else noise  # all pairs count alike in (4.4)
        if robust and turn > 2:
            before, weight = weight, pair_weights(residual, residual[low])
            if float(np.mean(np.abs(weight - before))) < 2e-3:
                break
    logs = _held_at_white(logs, pairs, weight)
    table = np.exp(logs - logs[:, -1:]).T
    table[0] = 0.0
    response = Response(np.maximum.accumulate(table, axis=0))
    named = {name: float(value) for name, value in zip(pairs.shots, errors, strict=True)}
    return ExposureResponseFit(response, named)


def _solve(pairs: ExposurePairs, basis: CurveBasis, weight: Array, noise: Array, *, alike: bool) -> tuple[Array, Array]:
    """log f⁻¹ (3, k), and the log exposure error of each shot.

    alike: pairs leave the scale of f⁻¹ to what lies beyond the brightest sample, so the channels share one there.
    """
    count, shots, rows = basis.design.shape[1], len(pairs.shots), len(pairs.first)
    unknowns = 3 * count + shots
    normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    every = np.arange(rows)
    shifts = np.zeros((rows, shots))
    shifts[every, pairs.first_shot] += 1.0
    shifts[every, pairs.second_shot] -= 1.0
    for channel in range(3):
        mean_1, curves_1 = basis.at(pairs.first[:, channel])
        mean_2, curves_2 = basis.at(pairs.second[:, channel])
        design = np.column_stack([curves_2 - curves_1, shifts])
        precision = weight / noise[:, channel] ** 2
        mine = np.concatenate([np.arange(count) + channel * count, 3 * count + np.arange(shots)])
        normal[np.ix_(mine, mine)] += (design.T * precision) @ design
        right[mine] += design.T @ (precision * (pairs.log_ratio - mean_2 + mean_1))
        own = mine[:count]
        normal[np.ix_(own, own)] += basis.precision
        right[own] += basis.wanted
    errors = 3 * count + np.arange(shots)
    normal[errors, errors] += 1.0 / pairs.spread**2
    # A common power of f⁻¹ and of all exposures explains the data as well: errors that grow with the exposure are
    # ruled out, so that the exposures as stated fix the power.
    normal[np.ix_(errors, errors)] += 1e8 * np.outer(pairs.shot_exposure, pairs.shot_exposure)
    if alike:  # at middle grey, within 2 %
        middle = basis.at(np.array([0.5]))[1][0] / 0.02
        for one, other in ((0, 1), (1, 2)):
            row = np.zeros(unknowns)
            row[one * count : (one + 1) * count], row[other * count : (other + 1) * count] = middle, -middle
            normal += np.outer(row, row)
    steps = len(basis.rising)
    rising = np.zeros((3 * steps, unknowns))
    for channel in range(3):
        rising[channel * steps : (channel + 1) * steps, channel * count : (channel + 1) * count] = basis.rising
    solution = solve_rising(normal, right, rising, np.tile(basis.least, 3))
    logs = basis.offset + solution[: 3 * count].reshape(3, count) @ basis.design.T
    return logs, solution[3 * count :]


def _held_at_white(logs: Array, pairs: ExposurePairs, weight: Array) -> Array:
    """Continue log f⁻¹ (3, k) above the brightest trusted sample as a power of EMoR's mean, with the slope that it has.

    What the least squares make of codes that no pair reaches depends on the noise alone.
    """
    codes, shape = np.linspace(0.0, 1.0, logs.shape[1]), log_inverse_emor().mean
    held = logs.copy()
    for channel in range(3):
        top = float(pairs.second[weight > 0.5, channel].max(initial=0.0))
        low = max(top - 16 / 255, 0.0)  # the span of a slope: a few times the noise of a code
        (lower, upper), (under, over) = (np.interp([low, top], codes, curve) for curve in (logs[channel], shape))
        beyond = codes > top
        held[channel, beyond] = upper + (upper - lower) / (over - under) * (shape[beyond] - over)
    return held


def _pair_residual(pairs: ExposurePairs, logs: Array, errors: Array) -> Array:
    """g(I') − g(I) − log k' (n, 3), with the exposure errors taken out."""
    codes = np.linspace(0.0, 1.0, logs.shape[1])
    ratio = pairs.log_ratio + errors[pairs.second_shot] - errors[pairs.first_shot]
    columns = [
        np.interp(pairs.second[:, c], codes, logs[c]) - np.interp(pairs.first[:, c], codes, logs[c]) - ratio
        for c in range(3)
    ]
    return np.stack(columns, axis=1)


def _log_noise(pairs: ExposurePairs, logs: Array) -> Array:
    """Standard deviation (n, 3) of g(I') − g(I) by the noise of the two JPEG values."""
    codes = np.linspace(0.0, 1.0, logs.shape[1])
    slopes = np.gradient(logs, codes, axis=1)
    columns = [
        np.hypot(
            np.interp(pairs.first[:, c], codes, slopes[c]),
            np.interp(pairs.second[:, c], codes, slopes[c]),
        )
        for c in range(3)
    ]
    return np.maximum(0.4 / 255.0 * np.stack(columns, axis=1), 1e-3)
