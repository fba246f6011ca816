"""The camera response f, from exposure pairs or from RAW/JPEG pairs (thesis 4.2.1).

From exposure pairs f⁻¹ is EMoR's in the log domain (4.3, 4.4); from RAW it is EMoR's in the linear domain, found
together with Ts. Both are linear least squares under the constraint that f⁻¹ rises. The "thesis" preset trusts all
colours below a saturation β and no others; the "lutforge" preset starts there and then trusts each colour by its
residual, so that what the gamut map moved drops out wherever it lies.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.inequality_least_squares import solve_lsi
from lutforge.calibration.options import Preset
from lutforge.errors import CalibrationError
from lutforge.model.emor import ResponseBasis, inverse_emor, log_inverse_emor
from lutforge.model.response import Response

Array = NDArray[np.float64]
Floats = NDArray[np.float64]

BETA = 0.3
"""HSV saturation below which a colour is taken to be untouched by the gamut map."""
NEAR_WHITE = 0.97
"""Nearer to white even unsaturated colours are moved, some of their pixels clip, and f⁻¹ is steepest: a few of them
turn a plain least-squares fit of Ts by several per cent (0.1 % without them, on the simulated camera)."""
CODE_NOISE = 0.4 / 255.0
"""Standard deviation of a JPEG value: rounding, and a little noise."""
COEFFICIENT_SPREAD = 2.5
"""Prior standard deviation of EMoR's first coefficient; that of the n-th is n times smaller."""
LOG_COEFFICIENT_SPREAD = 10.0
"""The same for the basis of the logarithm."""
CHANNEL_SPREAD = 0.02
"""How far the logarithms of the channels' f⁻¹ are expected to differ at middle grey."""
TRENDLESS = 1e4
LEAST_SLOPE = 0.02
"""f⁻¹ rises at least this fraction as fast as the mean curve."""
ROUNDS = 12
FIRST_ROUNDS = 2
"""Rounds that trust the saturation alone."""
OUTLIER = 3.0
"""A residual of so many times the median of the unsaturated colours counts a quarter (Geman-McClure)."""
LEAST_OUTLIER = 1.0 / 255.0
"""A residual of less is never evidence of a gamut map."""
LARGEST_BETA, LEAST_SHARE = 0.5, 0.35
"""Where few colours lie below β, as under a light that the white balance does not meet, the robust fit starts from this
share of the least saturated, if they lie below this saturation."""
LEAST_UNSATURATED = 8
LEAST_TONES = 0.25
"""The unsaturated colours must span this much of the encoded range, or the curve is a guess."""


def saturation(encoded: Array) -> Floats:
    """HSV saturation 1 − min/max of encoded colours (n, 3) → (n,); black is 0."""
    high = encoded.max(axis=1)
    return np.asarray(1.0 - encoded.min(axis=1) / np.maximum(high, 1e-6))


def untouched(encoded: Array, beta: float = BETA) -> NDArray[np.bool_]:
    """(n,) colours (n, 3) that a plain fit trusts: saturation below β, and not near white."""
    return np.asarray((saturation(encoded) < beta) & (encoded.max(axis=1) < NEAR_WHITE))


@dataclass(frozen=True, eq=False)
class RawResponseFit:
    """f and Ts of one style from RAW/JPEG pairs: f⁻¹(I) = Ts x where the gamut map leaves the colour alone.

    matrix: (3, 3), rows sum to 1, so that the scale between RAW and the JPEG is f's. weight: (n,) trust in [0, 1].
    rms: encoded, root mean square of the trusted.
    """

    response: Response
    matrix: Array
    weight: Floats
    rms: float


@dataclass(frozen=True, eq=False)
class ExposureResponseFit:
    """f of one style from exposure pairs, f(1) = 1.

    shot_error: by shot, the log of true over stated exposure. weight: (n,) trust in [0, 1] of each pair.
    """

    response: Response
    shot_error: dict[str, float]
    weight: Floats

    def pair_error(self, first: str, second: str) -> float:
        """What the stated exposure ratio of two shots must be multiplied by."""
        return float(np.exp(self.shot_error[second] - self.shot_error[first]))


# --- from RAW/JPEG pairs --------------------------------------------------------------------------------------------


def fit_response_to_raw(
    balanced: Array, encoded: Array, preset: Preset = "lutforge", beta: float = BETA
) -> RawResponseFit:
    """Fit f and Ts to white-balanced RAW balanced (n, 3) and JPEG values encoded (n, 3), neither clipped.

    Raises CalibrationError where there are no unsaturated colours, or they span too few tones.
    """
    chroma = saturation(encoded)
    beta = starting_beta(chroma, preset, beta)
    _check_tones(encoded, chroma < beta)
    basis = inverse_emor()
    trust = (chroma < beta).astype(np.float64) if preset == "thesis" else _soft_threshold(chroma, beta)
    slope = np.ones_like(encoded)
    tables, rows = np.zeros((len(basis.mean), 3)), np.eye(3)
    weight, rms = trust, np.inf
    for turn in range(ROUNDS):
        before = rms
        for channel in range(3):
            tables[:, channel], rows[channel] = _fit_raw_channel(balanced, encoded, channel, weight, slope, basis)
        response = Response(tables.copy())
        residual = np.linalg.norm(response.encode(balanced @ rows.T) - encoded, axis=1)
        slope = encoding_slope(response, encoded)
        if preset == "lutforge" and turn >= FIRST_ROUNDS:
            weight = _trust(residual, chroma < beta, LEAST_OUTLIER)
        rms = float(np.sqrt(np.average(residual**2, weights=weight)))
        if turn > FIRST_ROUNDS + 2 and abs(before - rms) < 1e-3 * rms:
            break
    return RawResponseFit(response, rows.copy(), weight, rms)


def starting_beta(chroma: Floats, preset: Preset, beta: float = BETA) -> float:
    """β itself, or for the robust fit what takes in enough of the least saturated colours."""
    if preset == "thesis" or (chroma < beta).sum() >= max(2 * LEAST_UNSATURATED, 0.15 * len(chroma)):
        return beta
    return float(np.clip(np.quantile(chroma, LEAST_SHARE), beta, LARGEST_BETA))


def _soft_threshold(chroma: Floats, beta: float) -> Floats:
    return np.asarray(1.0 / (1.0 + np.exp(np.clip((chroma - beta) / 0.03, -50.0, 50.0))))


def _trust(residual: Floats, reference: NDArray[np.bool_], least: float) -> Floats:
    """Geman-McClure weights: (1 + r²/s²)⁻² with s from the colours that are surely untouched."""
    scale = max(OUTLIER * float(np.median(residual[reference])), least)
    return np.asarray(1.0 / (1.0 + (residual / scale) ** 2) ** 2)


def encoding_slope(response: Response, encoded: Array) -> Array:
    """df/d(linear) at encoded values (n, 3), bounded so that no dark sample outweighs all others."""
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    step = np.gradient(response.inverse, codes, axis=0)
    slope = np.stack([np.interp(encoded[:, c], codes, step[:, c]) for c in range(3)], axis=1)
    return np.asarray(1.0 / np.maximum(slope, 0.05))


def _fit_raw_channel(
    balanced: Array, encoded: Array, channel: int, weight: Floats, slope: Array, basis: ResponseBasis
) -> tuple[Array, Array]:
    """One channel: scale·g0(I) + ξ·h(I) = m·x with Σ m = 1, the error counted in JPEG values."""
    others = [c for c in range(3) if c != channel]
    mean, curves = basis.at(encoded[:, channel])
    count = curves.shape[1]
    root = np.sqrt(weight) * slope[:, channel] / CODE_NOISE
    differences = balanced[:, others] - balanced[:, [channel]]
    design = np.column_stack([curves, mean, -differences]) * root[:, None]
    prior = np.zeros((count, count + 3))
    prior[:, :count] = np.diag((1 + np.arange(count)) / COEFFICIENT_SPREAD)
    steps = np.diff(basis.mean)
    rising = np.column_stack([np.diff(basis.curves, axis=1).T, (1 - LEAST_SLOPE) * steps, np.zeros((len(steps), 2))])
    scaled = np.column_stack([np.zeros((1, count)), 1.0, np.zeros((1, 2))])
    solution = solve_lsi(
        np.vstack([design, prior]),
        np.concatenate([balanced[:, channel] * root, np.zeros(count)]),
        np.vstack([rising, scaled]),
        np.concatenate([np.zeros(len(steps)), [0.01]]),
    )
    row = np.zeros(3)
    row[others] = solution[count + 1 :]
    row[channel] = 1.0 - row.sum()
    table = solution[count] * basis.mean + solution[:count] @ basis.curves
    return np.maximum.accumulate(table), row  # rounding only: the constraint keeps the steps positive


def _check_tones(encoded: Array, unsaturated: NDArray[np.bool_]) -> None:
    if unsaturated.sum() < LEAST_UNSATURATED:
        raise CalibrationError(
            f"{unsaturated.sum()} unsaturated colours; the response needs {LEAST_UNSATURATED}: "
            "shoot a grey card or a colour chart, at several exposures"
        )
    low, high = np.percentile(encoded[unsaturated, 1], [2, 98])
    if high - low < LEAST_TONES:
        raise CalibrationError(
            f"the unsaturated colours span JPEG values {255 * low:.0f} to {255 * high:.0f} only: "
            "shoot a grey card or a colour chart at several exposures, from dark to nearly clipped"
        )


# --- from exposure pairs --------------------------------------------------------------------------------------------


def fit_response_to_exposures(
    pairs: ExposurePairs, preset: Preset = "lutforge", beta: float = BETA
) -> ExposureResponseFit:
    """Fit f to JPEG values of the same surfaces in differently exposed shots, and each shot's exposure error.

    Raises CalibrationError where there are no pairs of unsaturated colours, or they span too few tones.
    """
    chroma = np.maximum(saturation(pairs.first), saturation(pairs.second))
    beta = starting_beta(chroma, preset, beta)
    low = chroma < beta
    _check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(low, 2))
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


def _solve_exposures(pairs: ExposurePairs, basis: ResponseBasis, weight: Floats, noise: Array, *, alike: bool) -> Array:
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


def _pair_residual(pairs: ExposurePairs, logs: Array, errors: Floats) -> Array:
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
