"""Measured spectra: sensitivities, lights and surface reflectances, all resampled to one wavelength axis.

The data ship with colour-science: sensitivities (NPL; Darrodi et al. 2015), CIE illuminants, the ColorChecker
(ISO 17321-1) and the 99 surfaces of the CIE 2017 colour fidelity index (paints, textiles, skin, plants,
plastics).
"""

import re
from functools import cache
from typing import Any

import colour
import numpy as np
from colour.quality.cfi2017 import load_TCS_CIE2017

from lutforge.arrays import Array
from lutforge.colour.srgb import D65, SRGB_TO_XYZ
from lutforge.errors import CalibrationError

WAVELENGTHS = np.arange(380.0, 781.0, 5.0)
"""Nanometres; L = 81."""


def _resampled(wavelengths: Array, values: Array) -> Array:
    """Columns of values at WAVELENGTHS; 0 outside the measured range."""
    return np.column_stack([np.interp(WAVELENGTHS, wavelengths, column, left=0.0, right=0.0) for column in values.T])


@cache
def sensitivities(dataset: str) -> Array:
    """A camera's spectral sensitivities (L, 3), each with maximum 1."""
    measured: Any = colour.MSDS_CAMERA_SENSITIVITIES[dataset]
    return _resampled(measured.wavelengths, measured.values)


@cache
def light(name: float | str) -> Array:
    """Relative spectral power (L,): a CIE illuminant by name, or CIE daylight of a temperature in kelvin."""
    spectrum: Any
    if isinstance(name, str):
        spectrum = colour.SDS_ILLUMINANTS[name]
    else:
        # c₂ was revised after the daylight locus was defined (CIE 15:2018, 4.1.2).
        xy = colour.temperature.CCT_to_xy_CIE_D(name * 1.4388 / 1.438)
        spectrum = colour.sd_CIE_illuminant_D_series(xy)
    return _resampled(spectrum.wavelengths, spectrum.values[:, None])[:, 0]


def spectrum_of(words: str) -> Array:
    """Relative spectral power (L,) of a light: a temperature ("5500K"), or a CIE illuminant ("D55", "A", "LED-B3").

    From 4000 K up a temperature is one of daylight, below one of a black body. Raises CalibrationError.
    """
    kelvin = re.fullmatch(r"(\d{4,5})\s*[kK]", words.strip())
    if kelvin is None:
        names = {name.lower(): name for name in colour.SDS_ILLUMINANTS}
        if words.strip().lower() not in names:
            raise CalibrationError(
                f'no light "{words[:40]}"; name a temperature (5500K) or a CIE illuminant (D55, A, FL2)'
            )
        return light(names[words.strip().lower()])
    temperature = float(kelvin[1])
    if not 1500.0 <= temperature <= 25000.0:
        raise CalibrationError(f"a light of {temperature:g} K is not within 1500 and 25000 K")
    if temperature >= 4000.0:
        return light(temperature)
    body: Any = colour.sd_blackbody(temperature, colour.SpectralShape(380, 780, 5))
    return np.asarray(body.values / body.values.max())


@cache
def reflectances(dataset: str) -> Array:
    """The patches of a chart (n, L) by its name in colour-science, in the chart's order."""
    patches: Any = colour.SDS_COLOURCHECKERS[dataset]
    return np.vstack([_resampled(patch.wavelengths, patch.values[:, None])[:, 0] for patch in patches.values()])


def chart_reflectances() -> Array:
    """The 24 patches of a ColorChecker Classic (24, L), row by row from dark skin to black."""
    return reflectances("ISO 17321-1")


@cache
def surface_reflectances() -> Array:
    """The 99 surfaces of the CIE 2017 colour fidelity index (99, L)."""
    surfaces: Any = load_TCS_CIE2017(colour.SpectralShape(380, 780, 5))
    return np.ascontiguousarray(surfaces.values.T)


def linear_srgb_under(reflectances: Array, spectrum: Array) -> Array:
    """Linear sRGB (n, 3) of surfaces (n, L) under a light (L,), diffuser = 1, adapted to D65 (Bradford)."""
    observer: Any = colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    weights = spectrum[:, None] * _resampled(observer.wavelengths, observer.values)
    white = weights.sum(axis=0) / weights[:, 1].sum()
    xyz = reflectances @ weights / weights[:, 1].sum()
    adapted = colour.chromatic_adaptation(xyz, white, D65, method="Von Kries", transform="Bradford")
    return np.asarray(adapted @ np.linalg.inv(SRGB_TO_XYZ).T)
