"""The camera response f and the matrix Ts from RAW/JPEG pairs: f⁻¹(I) = Ts x wherever the gamut map moves nothing.

f⁻¹ is EMoR's in the linear domain, so each round is linear least squares in f⁻¹ and Ts together, under the constraint
that f⁻¹ rises. Which colours the gamut map moved is not known. The "thesis" preset trusts all below a saturation β. The
"lutforge" preset weighs by residual, on a scale that shrinks to that of the noise, and by the odds that a saturation is
untouched: residuals alone cannot tell, for a few saturated surfaces that are moved alike agree on another Ts.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.options import Preset
from lutforge.calibration.physical.unsaturated import (
    BETA,
    check_tones,
    saturation,
    starting_beta,
    untouched_odds,
)
from lutforge.model.emor import inverse_emor
from lutforge.model.response import Response
from lutforge.solvers.inequality_least_squares import solve_lsi

Array = NDArray[np.float64]

CODE_NOISE = 0.4 / 255.0
"""Standard deviation of a JPEG value: rounding, and a little noise."""
COEFFICIENT_SPREAD = 2.5
"""Prior standard deviation of EMoR's first coefficient; that of the n-th is n times smaller."""
LEAST_SLOPE = 0.02
"""f⁻¹ rises at least this fraction as fast as the mean curve."""
FLATTEST = 0.05
"""Slopes of f⁻¹ below this count as this, so that no dark sample outweighs all others."""
FIRST_ROUNDS, MOST_ROUNDS = 2, 12
"""Rounds that trust the saturation alone, and all rounds."""
NOISE_SCALE = 3.0
"""A residual of so many times the median of the colours below β counts a quarter (Geman-McClure) …"""
FIRST_SCALE, SHRINKING, LEAST_SCALE = 1.0 / 255.0, 0.75, 0.3 / 255.0
"""… but not one below this, which shrinks from round to round to what rounding and noise make of a mean of pixels."""
REACHES = (1.0, 1.5, 2.0, 3.0)
MOST_DOUBT = 0.005
"""β is widened by these factors until the standard error of Ts is below this share of it."""
CURVE_ROUNDS, CURVE_SCALE, CURVE_REACH = 3, 1.5 / 255.0, 1.5
"""With Ts known f is followed to darker and brighter tones: residuals up to this scale, a β so many times as large."""
MOST_SAMPLES = 6000
"""Ts is fitted to a random choice of so many; f is to all."""


@dataclass(frozen=True, eq=False)
class RawResponseFit:
    """f and Ts of one style.

    matrix: (3, 3), rows sum to 1, so that the scale between RAW and the JPEG is f's. weight: (n,) trust in [0, 1].
    rms: encoded, root mean square of the trusted.
    """

    response: Response
    matrix: Array
    weight: Array
    rms: float


def fit_response_to_raw(
    balanced: Array, encoded: Array, preset: Preset = "lutforge", beta: float = BETA
) -> RawResponseFit:
    """Fit f and Ts to white-balanced RAW balanced (n, 3) and JPEG values encoded (n, 3), neither clipped.

    Raises CalibrationError where there are no unsaturated colours, or they span too few tones.
    """
    chroma = saturation(encoded)
    beta = starting_beta(chroma, preset, beta)
    check_tones(encoded, chroma < beta)
    if preset == "thesis":
        return _fit_below(balanced, encoded, (chroma < beta).astype(np.float64))
    rows = np.random.default_rng(0).permutation(len(chroma))[:MOST_SAMPLES]
    for reach in REACHES:
        fit = _fit_untouched(balanced[rows], encoded[rows], beta, reach)
        if fit.doubt <= MOST_DOUBT:
            break
    linear = balanced @ fit.matrix.T
    response = _follow(fit.response, linear, encoded, untouched_odds(chroma, CURVE_REACH * reach * beta), fit.scale)
    residual = _residual(response, linear, encoded)
    weight = untouched_odds(chroma, reach * beta) * _geman_mcclure(residual / fit.scale)
    return RawResponseFit(response, fit.matrix, weight, _rms(residual, weight))


def _fit_below(balanced: Array, encoded: Array, weight: Array) -> RawResponseFit:
    """All colours below β and no others."""
    slope, rms = np.ones_like(encoded), np.inf
    for turn in range(MOST_ROUNDS):
        before = rms
        response, matrix = _solve(balanced, encoded, weight, slope)
        slope = encoding_slope(response, encoded)
        rms = _rms(_residual(response, balanced @ matrix.T, encoded), weight)
        if turn > FIRST_ROUNDS and _settled(before, rms):
            break
    return RawResponseFit(response, matrix, weight, rms)


@dataclass(frozen=True, eq=False)
class _Untouched:
    """scale: of the residuals that noise explains, encoded; doubt: standard error of the matrix, relative to it."""

    matrix: Array
    response: Response
    scale: float
    doubt: float


def _fit_untouched(balanced: Array, encoded: Array, beta: float, reach: float) -> _Untouched:
    """Robust fit from the colours below β on, to colours of some times that saturation."""
    chroma = saturation(encoded)
    odds, reference = untouched_odds(chroma, reach * beta), chroma < beta
    slope, weight, rms, floor = np.ones_like(encoded), untouched_odds(chroma, beta), np.inf, FIRST_SCALE
    for turn in range(MOST_ROUNDS):
        before = rms
        response, matrix = _solve(balanced, encoded, weight, slope)
        slope = encoding_slope(response, encoded)
        residual = _residual(response, balanced @ matrix.T, encoded)
        rms = _rms(residual, weight)
        scale = max(NOISE_SCALE * float(np.median(residual[reference])), floor)
        if turn >= FIRST_ROUNDS:
            if floor == LEAST_SCALE and _settled(before, rms):
                break
            weight = odds * _geman_mcclure(residual / scale)
            floor = max(SHRINKING * floor, LEAST_SCALE)
    return _Untouched(matrix, response, scale, _doubt(balanced, encoded, matrix, weight, slope, rms))


def _settled(before: float, rms: float) -> bool:
    return abs(before - rms) < 1e-3 * rms


def _doubt(balanced: Array, encoded: Array, matrix: Array, weight: Array, slope: Array, rms: float) -> float:
    """Standard error of Ts, ‖·‖ relative to its own, whatever f is; inf where fewer colours count than are unknown."""
    basis = inverse_emor()
    freedom = float(weight.sum()) - len(basis.curves) - 3
    if freedom <= 0:
        return np.inf
    noise = rms**2 / 3 * float(weight.sum()) / freedom
    variance = 0.0
    for channel in range(3):
        others = [c for c in range(3) if c != channel]
        mean, curves = basis.at(encoded[:, channel])
        columns = np.column_stack([curves, mean, balanced[:, others] - balanced[:, [channel]]])
        factor = np.asarray(np.linalg.qr(columns * (np.sqrt(weight) * slope[:, channel])[:, None], mode="r"))
        told = factor[-2:, -2:]
        covariance = np.linalg.pinv(told.T @ told)
        variance += noise * float(np.trace(covariance) + covariance.sum())  # the row's entries sum to 1
    return float(np.sqrt(variance) / np.linalg.norm(matrix))


def _follow(response: Response, linear: Array, encoded: Array, odds: Array, scale: float) -> Response:
    """f alone, of Ts x (n, 3), which more colours tell than Ts: a channel may be darkest in a colour of some hue."""
    nothing = np.zeros((len(linear), 0))
    for _ in range(CURVE_ROUNDS):
        weight = odds * _geman_mcclure(_residual(response, linear, encoded) / max(scale, CURVE_SCALE))
        slope = encoding_slope(response, encoded)
        tables = [_fit_curve(linear[:, c], nothing, encoded[:, c], weight * slope[:, c] ** 2)[0] for c in range(3)]
        response = Response(np.stack(tables, axis=1))
    return response


def _geman_mcclure(ratio: Array) -> Array:
    return np.asarray(1.0 / (1.0 + ratio**2) ** 2)


def _residual(response: Response, linear: Array, encoded: Array) -> Array:
    """‖f⁻¹(I) − Ts x‖ (n,) in JPEG values."""
    error = (response.linearize(encoded) - linear) * encoding_slope(response, encoded)
    return np.asarray(np.linalg.norm(error, axis=1))


def _rms(residual: Array, weight: Array) -> float:
    return float(np.sqrt(np.average(residual**2, weights=weight)))


def encoding_slope(response: Response, encoded: Array) -> Array:
    """df/d(linear) at encoded values (n, 3), at most 1 / FLATTEST."""
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    step = np.gradient(response.inverse, codes, axis=0)
    slope = np.stack([np.interp(encoded[:, c], codes, step[:, c]) for c in range(3)], axis=1)
    return np.asarray(1.0 / np.maximum(slope, FLATTEST))


def _solve(balanced: Array, encoded: Array, weight: Array, slope: Array) -> tuple[Response, Array]:
    """f and Ts, a channel at a time: f⁻¹(I) = m·x with Σ m = 1, the error counted in JPEG values."""
    tables, matrix = [], np.zeros((3, 3))
    for channel in range(3):
        others = [c for c in range(3) if c != channel]
        own = balanced[:, channel]
        table, share = _fit_curve(
            own, balanced[:, others] - own[:, None], encoded[:, channel], weight * slope[:, channel] ** 2
        )
        matrix[channel, others], matrix[channel, channel] = share, 1.0 - share.sum()
        tables.append(table)
    return Response(np.stack(tables, axis=1)), matrix


def _fit_curve(own: Array, differences: Array, encoded: Array, weight: Array) -> tuple[Array, Array]:
    """One channel's f⁻¹ (1024,) and m (k,): scale·g0(I) + ξ·h(I) = own + m·differences; differences: (n, k)."""
    basis = inverse_emor()
    mean, curves = basis.at(encoded)
    count, mixed = curves.shape[1], differences.shape[1]
    root = np.sqrt(weight) / CODE_NOISE
    design = np.column_stack([curves, mean, -differences]) * root[:, None]
    prior = np.zeros((count, count + 1 + mixed))
    prior[:, :count] = np.diag((1 + np.arange(count)) / COEFFICIENT_SPREAD)
    steps = np.diff(basis.mean)
    none = np.zeros((len(steps), mixed))
    rising = np.column_stack([np.diff(basis.curves, axis=1).T, (1 - LEAST_SLOPE) * steps, none])
    scaled = np.concatenate([np.zeros(count), [1.0], np.zeros(mixed)])[None, :]
    solution = solve_lsi(
        np.vstack([design, prior]),
        np.concatenate([own * root, np.zeros(count)]),
        np.vstack([rising, scaled]),
        np.concatenate([np.zeros(len(steps)), [0.01]]),
    )
    table = solution[count] * basis.mean + solution[:count] @ basis.curves
    # Rounding only: the constraint keeps the steps positive.
    return np.maximum.accumulate(table), solution[count + 1 :]
