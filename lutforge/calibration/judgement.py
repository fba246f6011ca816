"""The judgement of a style's base by what that of every camera has: how far its samples are from what cameras make.

The base is a fit of matrix and response. Four things are measured, in codes of 255:

- unsaturated colours lie near it;
- its greys are grey under the multipliers that the files state;
- each channel of the JPEG is mostly that of the RAW;
- RAW rises as a power of JPEG values that is neither 1 nor far above 2, and white is not reached deep in the dark.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from lutforge.arrays import Array
from lutforge.calibration.matrix_and_response import (
    MatrixAndResponse,
    encoded_residual,
    in_gamut_weight,
)
from lutforge.calibration.options import BETA
from lutforge.colour.saturation import saturation
from lutforge.model.response import Response

FAR_OFF = 0.25
"""Encoded residuals count no more than this: what is further off is as wrong."""
LEAST_MEAN_WEIGHT = 1e-9
"""Least weight of a colour, so that samples without unsaturated colours have a mean."""

JUDGED_GREYS = 9
"""The number of greys whose response is judged, over the tones of the samples."""
LEAST_LINEAR = 1e-5
"""Least linear value of a grey that has a logarithm."""
USUAL_POWER = 2.2
"""The power of JPEG values as which RAW rises, about, in a usual camera."""

CODES_PER_STOP = 40
"""Codes that a stop between the channels of a grey counts; it is about as many."""
EXCHANGED_CHANNELS = 100
"""Codes that channels of the JPEG count which are not the same ones of the RAW."""
LEAST_POWER, MOST_POWER = 1.05, 2.4
"""RAW rises as a power of JPEG values between these."""
CODES_PER_POWER = 50
"""Codes that each step of 1 of the power beyond its bounds counts."""
DARKEST_WHITE = -1.9
"""Stops below a usual white where no camera's white lies."""
CODES_PER_STOP_OF_WHITE = 30
"""Codes that each stop counts by which white is darker than that."""


@dataclass(frozen=True, eq=False)
class StyleColours:
    """Samples of one style. raw, encoded, multipliers: (n, 3); has_stated_balance: the files state the multipliers."""

    raw: Array
    encoded: Array
    multipliers: Array
    has_stated_balance: bool

    @property
    def balanced(self) -> Array:
        """White-balanced RAW, (n, 3)."""
        return np.asarray(self.raw * self.multipliers)


@dataclass(frozen=True, eq=False)
class Judgement:
    """A base as judged by samples.

    rendered: (n, 3) the samples' RAW as the base renders it. tint: (3,) by how much each channel of greys is brighter
    than their mean, in stops. white: how much brighter than a usual one the RAW is that the base renders to white, in
    stops. colour_misfit: what no camera has of residuals, of tints, and of channels that are exchanged, in codes.
    misfit: this, and what no camera's response has, in codes.
    """

    rendered: Array
    tint: Array
    white: float
    colour_misfit: float
    misfit: float


def judge_base(colours: StyleColours, base: MatrixAndResponse) -> Judgement:
    """Judge the base of samples."""
    encoded = np.clip(colours.encoded, 0.0, 1.0)
    greys = _judged_greys(base.response, encoded)

    colour_misfit = EXCHANGED_CHANNELS * float(_exchanges_channels(base.matrix))
    if colours.has_stated_balance:  # else it may be the estimated multipliers that are wrong
        colour_misfit += _colour_residual(colours, base) + CODES_PER_STOP * float(np.ptp(greys.tint))

    response_misfit = CODES_PER_POWER * (max(0.0, LEAST_POWER - greys.power) + max(0.0, greys.power - MOST_POWER))
    response_misfit += CODES_PER_STOP_OF_WHITE * max(0.0, DARKEST_WHITE - greys.white)
    return Judgement(
        base.render(colours.balanced), greys.tint, greys.white, colour_misfit, colour_misfit + response_misfit
    )


def _colour_residual(colours: StyleColours, base: MatrixAndResponse) -> float:
    """The mean residual of unsaturated colours, in codes."""
    encoded = np.clip(colours.encoded, 0.0, 1.0)
    residual = np.minimum(encoded_residual(base.response, base.matrix, colours.balanced, encoded), FAR_OFF)
    return float(255 * np.average(residual, weights=in_gamut_weight(saturation(encoded), BETA) + LEAST_MEAN_WEIGHT))


def _exchanges_channels(matrix: Array) -> bool:
    """True where channels that a matrix (3, 3) makes are mostly not the same channels of the RAW."""
    best_order = linear_sum_assignment(-matrix)[1]
    return bool(np.any(best_order != np.arange(3)))


@dataclass(frozen=True, eq=False)
class _JudgedGreys:
    """The greys of a response. tint, white: as in `Judgement`; power: RAW rises as this power of JPEG values."""

    tint: Array
    white: float
    power: float


def _judged_greys(response: Response, encoded: Array) -> _JudgedGreys:
    """The greys of a response, over the tones of encoded colours (n, 3)."""
    dark, bright = np.percentile(encoded.mean(axis=1), (10, 90))
    greys = np.linspace(dark, bright, JUDGED_GREYS)
    linear = response.linearize(np.repeat(greys[:, None], 3, axis=1))
    stops = np.log2(np.maximum(linear, LEAST_LINEAR))
    level = stops.mean(axis=1)

    tint = np.median(stops - level[:, None], axis=0)
    power = float(np.polyfit(np.log2(greys), level, 1)[0])
    beyond_usual = level - USUAL_POWER * np.log2(greys)
    white = float(np.median(beyond_usual[JUDGED_GREYS // 2 :]))  # of the brighter half
    return _JudgedGreys(tint, white, power)
