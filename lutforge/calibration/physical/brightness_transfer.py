"""Brightness transfer functions: how JPEG and RAW values change with the exposure (thesis, chapter 3).

τ_k(I) = f(k f⁻¹(I)) (3.1). If f is a fixed property of the camera, all pairs of shots of one exposure ratio share one
τ, whatever the light and the white balance, but for small shifts (the shutter) and outliers (what the gamut map moved).

A shot that the camera rendered otherwise departs from the common function in its unsaturated colours.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.matrix_and_response import BETA, saturation
from lutforge.calibration.physical.response_from_exposures import ExposurePairs, fit_response_to_exposures
from lutforge.model.response import Response

OUTLIER = 3 / 255
"""A JPEG value this far from the camera's transfer function is an outlier, and so is its whole colour (3.2)."""
MERGED = 0.1
"""Ratios within so many stops are one."""
LARGEST_SHIFT = 3 / 255
"""A response is a fixed property of the camera below this shift of whole shots: a shutter 5 % off moves middle grey so
far."""
DARK_RAW = 0.02


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
    of the logarithm of RAW ratios within a pair, of the worst pair; fixed: whether all shifts are small.
    """

    outliers: float
    outliers_by_channel: tuple[float, float, float]
    inlier_saturation: float
    outlier_saturation: float
    shift: float
    raw_spread: float
    fixed: bool

    @property
    def told(self) -> str:
        """The verdict in words, with its figures."""
        return (
            f"the response {'is a fixed property of this camera' if self.fixed else 'is not the same in all shots'}: "
            f"unsaturated colours of the worst shot depart by {255 * self.shift:.1f} codes, "
            f"{100 * self.outliers:.0f} % of all colours by more than 3"
        )


def transfer_functions(pairs: ExposurePairs) -> tuple[TransferFunction, ...]:
    """The pairs by exposure ratio, each with the function that the camera's one response implies.

    Raises CalibrationError where the pairs do not determine a response.
    """
    response = fit_response_to_exposures(pairs).response
    of_all = fit_response_to_exposures(pairs, "thesis", np.inf).response
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
    worst = max((float(np.median(each)) for each in shifts.values()), default=0.0)
    r, g, b = (float(value) for value in by_channel.mean(axis=0))
    return ResponseVerdict(
        outliers=float(outlier.mean()),
        outliers_by_channel=(r, g, b),
        inlier_saturation=float(np.median(chroma[~outlier])) if (~outlier).any() else float("nan"),
        outlier_saturation=float(np.median(chroma[outlier])) if outlier.any() else float("nan"),
        shift=worst,
        raw_spread=max(spreads),
        fixed=worst < LARGEST_SHIFT,
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
