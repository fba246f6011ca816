"""Brightness transfer functions: how JPEG and RAW values change with the exposure (thesis, chapter 3).

τ_k(I) = f(k f⁻¹(I)) (3.1). Where f is a fixed property of the camera, all pairs of shots of one exposure ratio share
one τ, under any illuminant and white balance. Two effects remain: small shifts, since shutters are not exact, and
outliers, which are colours that the gamut map changed.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.response_from_exposures import fit_response_by_least_squares, fit_response_to_exposures
from lutforge.model.response import Response

OUTLIER = 3 / 255
"""A JPEG value this far from the camera's transfer function is an outlier, and so is its whole colour (3.2)."""
SAME_RATIO = 0.1
"""Exposure ratios within so many stops of each other share one function."""


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """The pairs of one exposure ratio, and their transfer function.

    stops: log2 k'; first, second: JPEG values (n, 3); raw_first, raw_second: (n, 3) or NaN; outlier: (n,); curve: τ at
    256 JPEG values (256, 3); curve_with_outliers: τ of an f that is fitted to all pairs, including outliers.
    """

    stops: float
    first: Array
    second: Array
    raw_first: Array
    raw_second: Array
    outlier: Mask
    curve: Array
    curve_with_outliers: Array


def transfer_functions(pairs: ExposurePairs) -> tuple[TransferFunction, ...]:
    """The pairs by exposure ratio, each with the function that the camera's one response implies.

    Raises CalibrationError where the pairs do not determine a response.
    """
    response = fit_response_to_exposures(pairs).response
    response_with_outliers = fit_response_by_least_squares(pairs, np.inf).response
    stops = pairs.log_ratio / np.log(2.0)
    functions = []
    for centre in _centres(stops):
        of_ratio = pairs.select(np.abs(stops - centre) <= SAME_RATIO)
        functions.append(
            TransferFunction(
                stops=float(centre),
                first=of_ratio.first,
                second=of_ratio.second,
                raw_first=of_ratio.raw_first,
                raw_second=of_ratio.raw_second,
                outlier=np.any(np.abs(of_ratio.residuals(response)) > OUTLIER, axis=1),
                curve=_curve(response, centre),
                curve_with_outliers=_curve(response_with_outliers, centre),
            )
        )
    return tuple(functions)


def _centres(stops: Array) -> list[float]:
    """The distinct exposure ratios, in stops."""
    centres: list[float] = []
    for value in np.unique(np.round(stops, 3)):
        if not centres or value - centres[-1] > 2 * SAME_RATIO:
            centres.append(float(np.median(stops[np.abs(stops - value) <= SAME_RATIO])))
    return centres


def _curve(response: Response, stops: float) -> Array:
    """τ (256, 3) of a response at 256 JPEG values."""
    codes = np.stack([np.linspace(0.0, 1.0, 256)] * 3, axis=1)
    return response.encode(2.0**stops * response.linearize(codes))
