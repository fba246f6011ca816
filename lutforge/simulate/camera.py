"""A camera whose every stage is known: measured sensitivities and a rendering chain in the thesis's terms.

render:     I = f(h(Ts · min(Tw · k · E, 1)))        linearize:  E = (k Tw)⁻¹ Ts⁻¹ h⁻¹(f⁻¹(I))
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.colour_temperature import D65_KELVIN
from lutforge.colour.spectra import chart_reflectances, light, linear_srgb_under, sensitivities, surface_reflectances
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.model.white_balance import WhiteBalance
from lutforge.simulate.gamut_map import SimulatedGamutMap
from lutforge.simulate.tone_response import ToneResponse

LIGHT_OF_WHITE_BALANCE: Mapping[str, float | str] = MappingProxyType(
    {"tungsten": "A", "fluorescent": "FL2", "daylight": 5200.0, "flash": 5500.0, "cloudy": 6000.0, "shade": 7500.0}
)
"""The light that each setting is made for: a CIE illuminant, or CIE daylight of a colour temperature."""


@dataclass(frozen=True, eq=False)
class SimulatedCamera:
    """The ground truth: sensor and rendering of one camera.

    sensitivity: (L, 3) over `spectra.WAVELENGTHS`, scaled so that E = reflectance · light · sensitivity. matrix: Ts
    (3, 3), white-balanced camera RGB to linear sRGB; rows sum to 1. white_balances: Tw of each setting. styles: h and f
    of each. nominal_exposure_s: the exposure at which a perfect diffuser reads 0.9 in its strongest channel. black,
    white: sensor codes of no light and of saturation. full_well, read_noise: electrons.
    """

    make: str
    model: str
    sensitivity: Array
    matrix: Array
    white_balances: Mapping[str, WhiteBalance]
    styles: Mapping[str, tuple[SimulatedGamutMap, ToneResponse]]
    nominal_exposure_s: float = 1 / 60
    black: int = 600
    white: int = 15520
    full_well: float = 40000.0
    read_noise: float = 4.0
    cfa: str = "RGGB"

    @property
    def name(self) -> str:
        """Make and model."""
        return f"{self.make} {self.model}"

    def expose(self, reflectances: ArrayLike, white_balance: str, exposure_s: float | None = None) -> Array:
        """E (…, 3) of reflectances (…, L) under the light of a white-balance setting: no noise, not clipped."""
        spectrum = light(LIGHT_OF_WHITE_BALANCE[white_balance])
        responses = spectrum[:, None] * self.sensitivity
        responses = responses * (0.9 / responses.sum(axis=0).max())
        times = 1.0 if exposure_s is None else exposure_s / self.nominal_exposure_s
        return np.asarray(times * (np.asarray(reflectances, dtype=np.float64) @ responses))

    def multipliers(self, white_balance: str | ArrayLike) -> Array:
        """Tw's diagonal (3,): of a named setting, or the given multipliers themselves."""
        if isinstance(white_balance, str):
            return np.asarray(self.white_balances[white_balance].multipliers)
        return np.asarray(white_balance, dtype=np.float64)

    def render(self, raw: ArrayLike, style: str, white_balance: str | ArrayLike, ev: float = 0.0) -> Array:
        """I = f(h(Ts min(Tw k E, 1))), k = 2^ev: RAW (…, 3) to encoded values in [0, 1], not quantized."""
        gamut_map, response = self.styles[style]
        balanced = np.clip(np.asarray(raw) * self.multipliers(white_balance) * 2.0**ev, 0.0, 1.0)
        return response(gamut_map(balanced @ self.matrix.T))

    def linearize(self, encoded: ArrayLike, style: str, white_balance: str | ArrayLike, ev: float = 0.0) -> Array:
        """E = (k Tw)⁻¹ Ts⁻¹ h⁻¹(f⁻¹(I)): encoded values (…, 3) to RAW, to about 1e-9 where none is 0 or 1."""
        gamut_map, response = self.styles[style]
        linear = gamut_map.inverse(response.inverse(encoded))
        balanced = linear @ np.linalg.inv(self.matrix).T
        return np.asarray(balanced / (self.multipliers(white_balance) * 2.0**ev))

    def color_matrix(self) -> Array:
        """XYZ → camera RGB (3, 3), as DNG's ColorMatrix1 wants it: D65 gives what the sensor sees of D65, green = 1."""
        balanced = np.linalg.inv(self.matrix) @ np.linalg.inv(SRGB_TO_XYZ)
        neutral = light(D65_KELVIN) @ self.sensitivity
        return np.asarray(balanced * (neutral / neutral[1])[:, None])


@cache
def nikon_d5100() -> SimulatedCamera:
    """A camera with the sensitivities of a Nikon D5100 as measured by the NPL (Darrodi et al. 2015)."""
    return _build("Simulated D5100", sensitivities("Nikon 5100 (NPL)") * (0.85, 1.0, 0.85))


@cache
def sigma_sd_merrill() -> SimulatedCamera:
    """A camera with other filters: the NPL's Sigma SD Merrill (Darrodi et al. 2015), its layers unmixed, cut at 0."""
    unmixing = np.array([[1.0, -0.6, 0.0], [-0.64, 1.0, -0.64], [0.0, -0.52, 1.0]])  # what neighbouring layers see too
    unmixed = np.maximum(sensitivities("Sigma SDMerill (NPL)") @ unmixing, 0.0)
    return _build("Simulated SD Merrill", unmixed / unmixed.max(axis=0) * (1.0, 1.0, 0.78), warmth=0.03)


def _build(model: str, sensitivity: Array, warmth: float = 0.0) -> SimulatedCamera:
    """White balances and matrix follow from the sensor; the styles are the maker's taste."""
    balances = {}
    for name, illuminant in LIGHT_OF_WHITE_BALANCE.items():
        r, g, b = (float(value) for value in light(illuminant) @ sensitivity)
        kelvin = {"A": 2856.0, "FL2": 4230.0}[illuminant] if isinstance(illuminant, str) else illuminant
        balances[name] = WhiteBalance((g / r, 1.0, g / b), kelvin)
    matrix = _fit_matrix(sensitivity)
    signal = np.array([0.25, 0.5, 0.25]) @ np.linalg.inv(matrix)
    w = (float(signal[0]), float(signal[1]), float(signal[2]))
    looks = {
        "standard": (SimulatedGamutMap(w, knee=0.6, onset=0.5, turn=warmth), 0.26, 0.94),
        "vivid": (SimulatedGamutMap(w, knee=0.7, boost=0.9, turn=0.1 + warmth, bend=0.15), 0.2, 0.97),
        "landscape": (SimulatedGamutMap(w, knee=0.65, boost=0.5, turn=warmth - 0.06, bend=-0.14), 0.23, 0.95),
    }
    styles = {
        name: (gamut_map, ToneResponse((toe,) * 3, (shoulder,) * 3))
        for name, (gamut_map, toe, shoulder) in looks.items()
    }
    return SimulatedCamera("LutForge", model, sensitivity, matrix, MappingProxyType(balances), MappingProxyType(styles))


def _fit_matrix(sensitivity: Array) -> Array:
    """Ts by least squares over the training surfaces under daylight, each row constrained to sum to 1."""
    reflectances = np.vstack([surface_reflectances(), chart_reflectances()])
    spectrum = light(5200.0)
    balanced = (reflectances * spectrum) @ sensitivity / (spectrum @ sensitivity)
    linear = linear_srgb_under(reflectances, spectrum)
    # row · x = y with row_g = 1 − row_r − row_b:  row_r (x_r − x_g) + row_b (x_b − x_g) = y − x_g
    unknowns, *_ = np.linalg.lstsq(balanced[:, [0, 2]] - balanced[:, [1]], linear - balanced[:, [1]])
    red, blue = unknowns
    return np.column_stack([red, 1 - red - blue, blue])
