"""Brightness transfer functions: how JPEG and RAW values change with the exposure (thesis, chapter 3).

τ_k(I) = f(k f⁻¹(I)) (3.1). If f is a fixed property of the camera, all pairs of shots of one exposure ratio share one
τ, whatever the light and the white balance, but for small shifts (the shutter) and outliers (what the gamut map moved).

Whether all shots have one response shows in how much better a curve per shot predicts surfaces that were left out.
Errors of the shutter, and another f that all shots share, do not count as a departure of single shots. The remaining
departures are compared with the noise of the pairs, whatever its cause: quantization, compression, or a gamut map that
changes some colours.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.matrix_and_response import saturation
from lutforge.calibration.options import BETA
from lutforge.calibration.response_from_exposures import fit_response_by_least_squares, fit_response_to_exposures
from lutforge.model.response import Response
from lutforge.solvers.cross_validation import leave_groups_out
from lutforge.solvers.robust_weights import RobustWeights, cauchy

OUTLIER = 3 / 255
"""A JPEG value this far from the camera's transfer function is an outlier, and so is its whole colour (3.2)."""
MERGED = 0.1
"""Ratios within so many stops are one."""
LARGEST_SHIFT, OWN_CURVES = 3 / 255, 0.1
"""A response is a fixed property of the camera below this shift of whole shots, as a shutter 5 % off moves middle grey
so far, and below this share that curves of shots explain: it is 1 % at most of 48 fixed simulated cameras, and 3 and
6 % of two real brackets."""
DARK_RAW, NEAR_WHITE = 0.02, 0.98
SLOWEST = 1e-3
"""Slope of f⁻¹ at least, so that black has a slope."""
DEPENDENT = 1e-6
"""Terms whose squares differ by this share are nearly dependent."""


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """The pairs of one exposure ratio.

    stops: log2 k'; first, second: JPEG values (n, 3); raw_first, raw_second: (n, 3) or NaN; outlier: (n,); curve: τ at
    256 JPEG values (256, 3); of_all: τ by an f that is fitted to outliers, too.
    """

    stops: float
    first: Array
    second: Array
    raw_first: Array
    raw_second: Array
    outlier: Mask
    curve: Array
    of_all: Array


@dataclass(frozen=True)
class ResponseVerdict:
    """Whether the response is a fixed property of the camera, in figures.

    outliers: share of the colours that leave the common function, by channel and of whole colours; inlier_saturation,
    outlier_saturation: their median HSV saturation; shift: the median departure of unsaturated colours from the common
    function, in the middle one of the channels, of the worst shot (median over its pairs), 1 = full scale; raw_spread:
    of the logarithm of RAW ratios within a pair, of the worst pair; own_curves: share of the variance of left-out
    unsaturated pairs that a curve of each shot explains beyond the common one; fixed: whether all shifts and that are
    small.
    """

    outliers: float
    outliers_by_channel: tuple[float, float, float]
    inlier_saturation: float
    outlier_saturation: float
    shift: float
    raw_spread: float
    own_curves: float
    fixed: bool

    @property
    def told(self) -> str:
        """The verdict in words, with its figures."""
        return (
            f"the response {'is a fixed property of this camera' if self.fixed else 'is not the same in all shots'}: "
            f"unsaturated colours of the worst shot depart by {255 * self.shift:.1f} codes, "
            f"{100 * self.outliers:.0f} % of all colours by more than 3; a curve of its own for each shot explains "
            f"{100 * max(self.own_curves, 0.0):.0f} % of what is left (10 % or more: something adapts to the scene)"
        )


def transfer_functions(pairs: ExposurePairs) -> tuple[TransferFunction, ...]:
    """The pairs by exposure ratio, each with the function that the camera's one response implies.

    Raises CalibrationError where the pairs do not determine a response.
    """
    response = fit_response_to_exposures(pairs).response
    of_all = fit_response_by_least_squares(pairs, np.inf).response
    stops = pairs.log_ratio / np.log(2.0)
    result = []
    for centre in _centres(stops):
        mine = pairs.select(np.abs(stops - centre) <= MERGED)
        outlier = np.any(np.abs(mine.departure(response)) > OUTLIER, axis=1)
        values = mine.first, mine.second, mine.raw_first, mine.raw_second
        curves = _curve(response, centre), _curve(of_all, centre)
        result.append(TransferFunction(float(centre), *values, outlier, *curves))
    return tuple(result)


def judge(pairs: ExposurePairs, response: Response | None = None) -> ResponseVerdict:
    """Outliers and shifts over all pairs, from the function that a response implies; none: the one of the pairs.

    Raises CalibrationError where the pairs do not determine a response.
    """
    response = response or fit_response_to_exposures(pairs).response
    departure = pairs.departure(response)
    by_channel = np.abs(departure) > OUTLIER
    outlier = by_channel.any(axis=1)
    chroma = np.maximum(saturation(pairs.first), saturation(pairs.second))
    shifts: dict[int, list[float]] = {}
    spreads = [0.0]
    for pair in np.unique(pairs.of_shots):
        rows = pairs.of_shots == pair
        plain = rows & (chroma < BETA)
        if plain.sum() >= 3:
            # The middle one of the channels: the gamut map may move one alone; an exposure, a white balance or
            # another response moves two.
            shift = float(np.median(np.abs(np.median(departure[plain], axis=0))))
            for shot in divmod(int(pair), len(pairs.shots)):
                shifts.setdefault(shot, []).append(shift)
        bright = rows & np.all(pairs.raw_first > DARK_RAW, axis=1)
        if bright.sum() >= 3:
            logs = np.log(pairs.raw_second[bright] / pairs.raw_first[bright])
            spreads.append(float(np.median(np.abs(logs - np.median(logs)))))
    own = share_of_own_curves(pairs, response, chroma < BETA)
    worst = max((float(np.median(each)) for each in shifts.values()), default=0.0)
    r, g, b = (float(value) for value in by_channel.mean(axis=0))
    return ResponseVerdict(
        outliers=float(outlier.mean()),
        outliers_by_channel=(r, g, b),
        inlier_saturation=float(np.median(chroma[~outlier])) if (~outlier).any() else float("nan"),
        outlier_saturation=float(np.median(chroma[outlier])) if outlier.any() else float("nan"),
        shift=worst,
        raw_spread=max(spreads),
        own_curves=own,
        fixed=worst < LARGEST_SHIFT and own < OWN_CURVES,
    )


def _centres(stops: Array) -> list[float]:
    """The distinct exposure ratios, in stops."""
    centres: list[float] = []
    for value in np.unique(np.round(stops, 3)):
        if not centres or value - centres[-1] > 2 * MERGED:
            centres.append(float(np.median(stops[np.abs(stops - value) <= MERGED])))
    return centres


def _curve(response: Response, stops: float) -> Array:
    codes = np.stack([np.linspace(0.0, 1.0, 256)] * 3, axis=1)
    return response.encode(2.0**stops * response.linearize(codes))


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
    weight = np.sqrt(RobustWeights(cauchy, multiple=3, least=DEPENDENT)(np.abs(residual_of_common)))
    residuals = np.zeros((2, len(departure)))
    for held in leave_groups_out(np.repeat(surfaces, 3)):
        for residual, terms in zip(residuals, (common, np.hstack([common, own])), strict=True):
            found = _solution((weight[:, None] * terms)[~held], (weight * departure)[~held])
            residual[held] = (weight * (departure - terms @ found))[held]
    without, with_own = np.sum(residuals**2, axis=1)
    return float(1.0 - with_own / max(without, DEPENDENT**2))


def _terms(pairs: ExposurePairs, response: Response) -> tuple[Array, Array, Array]:
    """Return terms of what shots share (3 n, p) and of single shots (3 n, q), and the departures of pairs (3 n,).

    Two shots that depart from f by δ and δ' change I' − τ(I) by δ'(I') − τ'(I) δ(I), where τ' is the slope of the
    brightness transfer function. δ of a single shot is a sum of sin πI and sin 2πI, which describe a gamma, lifted
    shadows, held highlights and a contrast. What shots share is a sum up to sin 6πI, and the errors of their shutters.
    Each row is scaled to the noise of one JPEG value.
    """
    first, second, ratio = pairs.first, pairs.second, np.exp(pairs.log_ratio)[:, None]
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    speed = np.maximum(np.gradient(response.inverse, codes, axis=0), SLOWEST)
    light = ratio * response.linearize(first)
    expected = response.encode(light)
    before, after = (
        np.stack([np.interp(side[:, c], codes, speed[:, c]) for c in range(3)], axis=1) for side in (first, expected)
    )
    slope = ratio * before / after
    scale = np.where(np.all(expected < NEAR_WHITE, axis=1)[:, None], 1.0 / np.hypot(1.0, slope), 0.0)
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
    return np.asarray(np.linalg.pinv(terms.T @ terms, rcond=DEPENDENT, hermitian=True) @ (terms.T @ values))
