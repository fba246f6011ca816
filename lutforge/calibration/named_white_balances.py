"""The white balances of a profile by their names: those of its shots, and presets that the camera's matrix gives."""

import re
from collections.abc import Mapping

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.colour_temperature import (
    COOLEST,
    D65_KELVIN,
    HOTTEST,
    camera_from_xyz,
    locus,
    multipliers_of,
)
from lutforge.model.white_balance import NAMED_KELVIN, WhiteBalance
from lutforge.samples.sample_set import SampleSet

PRESETS = ("tungsten", "daylight", "cloudy", "shade")
"""Settings that a profile of automatic shots gets by its matrix."""
NATURAL_LIGHTS = (2500.0, 5000.0, 10000.0)
"""Temperatures, in kelvin, of lights that every camera has multipliers for."""
MATRIX_DEVIATION = (-0.95e-4, 0.0, -1.3e-4)
"""By how much the logarithm of a true multiplier grows beyond the matrix's for each mired from D65: r, g, b.

A matrix that is least squares under daylight takes warm light for less warm than it is. Medians of the 52 cameras whose
spectral sensitivities rawtoaces publishes: 2 % in red and 3 % in blue under tungsten, half of the error there. On 28
other cameras (Jiang et al. 2013) it takes a third off the error.
"""


def named_white_balances(samples: SampleSet, multipliers: Array, matrix: Array) -> dict[str, WhiteBalance]:
    """One white balance for each name that shots have, and for presets that no shot was taken with.

    matrix: Ts (3, 3), for the presets.
    """
    balances = {str(name): _of_shots(samples, multipliers, str(name)) for name in np.unique(samples.white_balance)}
    return {**balances, **_presets(samples, balances, matrix)}


def _of_shots(samples: SampleSet, multipliers: Array, name: str) -> WhiteBalance:
    """The white balance of a name: that of its middle shot, and how far other shots are from it.

    The middle shot is the one nearest to the median of each channel, which no shot need have.
    """
    rows = samples.white_balance == name
    shots = np.array(
        [np.median(multipliers[rows & (samples.shot == shot)], axis=0) for shot in np.unique(samples.shot[rows])]
    )
    distance = np.abs(np.log(shots / np.median(shots, axis=0))).max(axis=1)
    middle = shots[np.argmin(distance)]
    r, b = float(middle[0] / middle[1]), float(middle[2] / middle[1])
    spread = float(np.max(np.abs(shots / middle - 1.0)))
    return WhiteBalance((r, 1.0, b), named_temperature(name), spread, float(middle[1]))


def _presets(samples: SampleSet, balances: Mapping[str, WhiteBalance], matrix: Array) -> dict[str, WhiteBalance]:
    """Presets by matrix and locus, where no white balance of the shots states a temperature, as on automatic.

    The camera's colorimetric matrix serves, as in RAW developers. Where only its multipliers of light D65 are known,
    they anchor the fitted matrix, which contains the camera's look.
    """
    stated = [named_temperature(name) for name in balances if "fluorescent" not in name]
    if not samples.is_own_raw or any(stated):
        return {}

    colorimetric = colorimetric_matrix(samples)
    d65 = np.array([np.median(samples.d65_r), 1.0, np.median(samples.d65_b)])
    if colorimetric is not None:
        from_xyz, deviation = colorimetric, np.zeros(3)
    elif np.all(np.isfinite(d65)):
        from_xyz, deviation = camera_from_xyz(matrix, d65, D65_KELVIN), np.array(MATRIX_DEVIATION)
    else:
        return {}

    presets = {}
    for name in PRESETS:
        kelvin = NAMED_KELVIN[name]
        correction = np.exp(deviation * (1e6 / kelvin - 1e6 / D65_KELVIN))
        r, g, b = (float(value) for value in correction * multipliers_of(locus(kelvin), from_xyz))
        if min(r, b) > 0.0:  # the matrix of samples that no camera made may have no such light
            presets[name] = WhiteBalance((r, g, b), kelvin)
    return presets


def colorimetric_matrix(samples: SampleSet) -> Array | None:
    """The matrix (3, 3) XYZ → RAW of the camera, as LibRaw or its DNG files have it; None where unknown."""
    matrix = np.median(samples.from_xyz, axis=0).reshape(3, 3)
    # A matrix that is none of a camera's has no multipliers for natural light
    whites = np.array([multipliers_of(locus(kelvin), matrix) for kelvin in NATURAL_LIGHTS])
    known = samples.is_own_raw and np.all(np.isfinite(whites)) and np.all(whites > 0.0)
    return matrix if known else None


def named_temperature(name: str) -> float | None:
    """The temperature in kelvin of a setting's name: "daylight", "5600k"; None where it has none."""
    number = re.fullmatch(r"(\d{4,5}) ?k(?:elvin)?", name)
    if number and COOLEST <= float(number[1]) <= HOTTEST:
        return float(number[1])
    return NAMED_KELVIN.get(name)
