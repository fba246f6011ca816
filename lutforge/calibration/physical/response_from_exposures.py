"""The camera response f from exposure pairs (thesis 4.2.1): EMoR in the log domain (4.3, 4.4).

Linear least squares under the constraint that f⁻¹ rises. The "thesis" preset trusts all colours below a saturation β
and no others; the "lutforge" preset starts there and then trusts each pair by its residual.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import Preset
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.calibration.physical.response_from_raw import CODE_NOISE, LEAST_SLOPE
from lutforge.calibration.physical.unsaturated import BETA, check_tones, saturation, starting_beta
from lutforge.model.emor import ResponseBasis, log_inverse_emor
from lutforge.model.response import Response
from lutforge.solvers.inequality_least_squares import solve_lsi

Array = NDArray[np.float64]

LOG_COEFFICIENT_SPREAD = 10.0
"""Prior standard deviation of the first coefficient; that of the n-th is n times smaller."""
CHANNEL_SPREAD = 0.02
"""How far the logarithms of the channels' f⁻¹ are expected to differ at middle grey."""
TRENDLESS = 1e4
ROUNDS = 12
FIRST_ROUNDS = 2
"""Rounds that trust the saturation alone."""
OUTLIER = 3.0
"""A residual of so many times the median of the unsaturated colours counts a quarter (Geman-McClure)."""


@dataclass(frozen=True, eq=False)
class ExposureResponseFit:
    """f of one style from exposure pairs, f(1) = 1.

    shot_error: by shot, the log of true over stated exposure. weight: (n,) trust in [0, 1] of each pair.
    """

    response: Response
    shot_error: dict[str, float]
    weight: Array

    def pair_error(self, first: str, second: str) -> float:
        """What the stated exposure ratio of two shots must be multiplied by."""
        return float(np.exp(self.shot_error[second] - self.shot_error[first]))


def fit_response_to_exposures(
    pairs: ExposurePairs, preset: Preset = "lutforge", beta: float = BETA
) -> ExposureResponseFit:
    """Fit f to JPEG values of the same surfaces in differently exposed shots, and each shot's exposure error.

    Raises CalibrationError where there are no pairs of unsaturated colours, or they span too few tones.
    """
    chroma = np.maximum(saturation(pairs.first), saturation(pairs.second))
    beta = starting_beta(chroma, preset, beta)
    low = chroma < beta
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(low, 2))
    basis = log_inverse_emor()
    weight = low.astype(np.float64) if preset == "thesis" else _soft_threshold(chroma, beta)
    noise = np.full(pairs.first.shape, 0.02)
    for turn in range(3 if preset == "thesis" else ROUNDS):
        solution = _solve_exposures(pairs, basis, weight, noise, alike=preset == "lutforge")
        curves, errors = solution[: -len(pairs.shots)].reshape(3, -1), solution[-len(pairs.shots) :]
        logs = basis.mean + curves @ basis.curves
        residual = _pair_residual(pairs, logs, errors)
        if preset == "lutforge":
            noise, before = _log_noise(pairs, logs), weight
            if turn >= FIRST_ROUNDS:
                weight = _trust(np.max(np.abs(residual) / noise, axis=1), low, 1.0)
                if float(np.mean(np.abs(weight - before))) < 2e-3:
                    break
    table = np.exp(logs).T
    table[0] = 0.0
    response = Response(np.maximum.accumulate(table, axis=0))
    named = {name: float(value) for name, value in zip(pairs.shots, errors, strict=True)}
    return ExposureResponseFit(response, named, weight)


def _soft_threshold(chroma: Array, beta: float) -> Array:
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((chroma - beta) / 0.03, -50.0, 50.0))))


def _trust(residual: Array, reference: NDArray[np.bool_], least: float) -> Array:
    """Geman-McClure weights: (1 + r²/s²)⁻² with s from the colours that are surely untouched."""
    scale = max(OUTLIER * float(np.median(residual[reference])), least)
    return np.asarray(1.0 / (1.0 + (residual / scale) ** 2) ** 2)


def _solve_exposures(pairs: ExposurePairs, basis: ResponseBasis, weight: Array, noise: Array, *, alike: bool) -> Array:
    """ξ of the three channels, one after the other, then the log exposure error of each shot.

    alike: pairs leave the scale of f⁻¹ to what lies beyond the brightest sample, so the channels share one there.
    """
    count, shots, rows = len(basis.curves), len(pairs.shots), len(pairs.first)
    design = np.zeros((3 * rows, 3 * count + shots))
    target = np.zeros(3 * rows)
    every = np.arange(rows)
    for channel in range(3):
        mean_1, curves_1 = basis.at(pairs.first[:, channel])
        mean_2, curves_2 = basis.at(pairs.second[:, channel])
        root = np.sqrt(weight) / noise[:, channel]
        here = slice(channel * rows, (channel + 1) * rows)
        design[here, channel * count : (channel + 1) * count] = (curves_2 - curves_1) * root[:, None]
        design[channel * rows + every, 3 * count + pairs.first_shot] = root
        design[channel * rows + every, 3 * count + pairs.second_shot] = -root
        target[here] = (pairs.log_ratio - mean_2 + mean_1) * root
    stiff = np.concatenate(
        [np.tile((1 + np.arange(count)) / LOG_COEFFICIENT_SPREAD, 3), np.full(shots, 1 / pairs.spread)]
    )
    # A common power of f⁻¹ and of all exposures explains the data as well: errors that grow with the exposure are
    # ruled out, so that the exposures as stated fix the power.
    trend = np.concatenate([np.zeros(3 * count), pairs.shot_exposure])[None, :] * TRENDLESS
    middle = basis.at(np.array([0.5]))[1][0] / CHANNEL_SPREAD
    none = np.zeros(count)
    shared = [np.concatenate([middle, -middle, none]), np.concatenate([none, -middle, middle])] if alike else []
    prior = np.vstack([np.diag(stiff), trend, *(np.concatenate([row, np.zeros(shots)])[None, :] for row in shared)])
    steps = np.diff(basis.mean[1:])
    rising = np.zeros((3 * len(steps), 3 * count + shots))
    for channel in range(3):
        here = slice(channel * len(steps), (channel + 1) * len(steps))
        rising[here, channel * count : (channel + 1) * count] = np.diff(basis.curves[:, 1:], axis=1).T
    return solve_lsi(
        np.vstack([design, prior]),
        np.concatenate([target, np.zeros(len(prior))]),
        rising,
        np.tile((LEAST_SLOPE - 1.0) * steps, 3),
    )


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
    return np.maximum(CODE_NOISE * np.stack(columns, axis=1), 1e-3)
