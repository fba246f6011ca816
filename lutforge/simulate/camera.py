"""A camera whose every stage is known: measured sensitivities and a rendering chain in the thesis's terms.

render:     I = f(h(Ts · min(Tw · k · E, 1)))        linearize:  E = (k Tw)⁻¹ Ts⁻¹ h⁻¹(f⁻¹(I))
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.colour_temperature import D65_KELVIN
from lutforge.colour.spectra import chart_reflectances, light, linear_srgb_under, sensitivities, surface_reflectances
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_decode, srgb_encode
from lutforge.model.white_balance import WhiteBalance

LIGHT_OF_WHITE_BALANCE: Mapping[str, float | str] = MappingProxyType(
    {"tungsten": "A", "fluorescent": "FL2", "daylight": 5200.0, "flash": 5500.0, "cloudy": 6000.0, "shade": 7500.0}
)
"""The light that each setting is made for: a CIE illuminant, or CIE daylight of a colour temperature."""


# --- Its colour mapping h, linear sRGB → linear sRGB, and its response f, linear sRGB → encoded ----------------------
# A colour p is split into Y = w·p, its signal on the sensor, and the chroma c = p − Y (1, 1, 1). h leaves Y alone and
# turns and scales c: so every slice of equal Y is mapped onto itself, along rays up to a turn, and h is one-to-one
# where its radial curve increases. Low saturations do not move: h(p) = p, as section 4.2.1 of the thesis assumes. f is
# one film-like curve per channel. Both are smooth and exactly invertible.


@dataclass(frozen=True)
class ToneResponse:
    """f(x) = S(srgb(x)): the sRGB curve (IEC 61966-2-1), then a cubic Bézier curve from (0, 0) to (1, 1).

    S(v) = 3 toe v (1 − v)² + 3 shoulder v² (1 − v) + v³ increases strictly where 0 < toe ≤ shoulder < 1.
    """

    toe: tuple[float, float, float]
    shoulder: tuple[float, float, float]

    def __call__(self, linear: ArrayLike) -> Array:
        """f: linear sRGB (…, 3), clipped to [0, 1] as the camera does, to encoded values in [0, 1]."""
        clipped = np.clip(linear, 0.0, 1.0)
        return np.where(clipped < 1, self._curve(srgb_encode(clipped)), 1.0)  # rounding must not hide a clip

    def inverse(self, encoded: ArrayLike) -> Array:
        """f⁻¹: encoded values (…, 3), clipped to [0, 1], to linear sRGB in [0, 1], to about 1e-12."""
        target = np.clip(encoded, 0.0, 1.0)
        return srgb_decode(invert_increasing(self._curve, target, 0.0, 1.0))

    def _curve(self, v: Array) -> Array:
        toe, shoulder = np.asarray(self.toe), np.asarray(self.shoulder)
        return np.asarray(v * (3 * toe * (1 - v) ** 2 + v * (3 * shoulder * (1 - v) + v)))


def invert_increasing(function: Callable[[Array], Array], target: Array, low: float, high: float) -> Array:
    """Solve function(x) = target for x in [low, high], where it increases strictly, by bisection to float precision."""
    a: Array = np.full(target.shape, low)
    b: Array = np.full(target.shape, high)
    for _ in range(54):
        middle = (a + b) / 2
        below = function(middle) < target
        a, b = np.where(below, middle, a), np.where(below, b, middle)
    return a / 2 + b / 2


DARKEST = 1e-12
"""Signals below this count as black, so that saturation stays finite."""


@dataclass(frozen=True)
class SimulatedGamutMap:
    """The map h: it compresses saturated colours into the cube, and for a vivid style boosts and turns them first.

    signal: w (3,), sum 1. knee: the saturation (1 = face of the RGB cube) from which colours are compressed. boost:
    gain of saturations beyond `onset`. turn: radians by which full saturations turn; bend: a part of the turn that
    depends on the hue. It does not fold where knee and |bend| are below 1.
    """

    signal: tuple[float, float, float]
    knee: float
    onset: float = 0.4
    boost: float = 0.0
    turn: float = 0.0
    bend: float = 0.0

    def __call__(self, linear: ArrayLike) -> Array:
        """h: linear sRGB (…, 3) as the sensor gives it, to linear sRGB that fits the cube."""
        level, chroma = self._split(linear)
        turned = self._turned(level, chroma)
        saturation = self._saturation(level, turned)
        scale = np.where(saturation > 0, self._curve(saturation) / np.maximum(saturation, DARKEST), 1.0)
        return level[..., None] + scale[..., None] * turned

    def inverse(self, mapped: ArrayLike) -> Array:
        """h⁻¹, to about 1e-10 where h reaches; colours out of its reach go to a very saturated one."""
        level, chroma = self._split(mapped)
        saturation = np.minimum(self._saturation(level, chroma), 1 - 1e-9)  # beyond, mapped ones cannot be told apart
        wide = invert_increasing(self._curve, saturation, 0.0, 60.0)  # far outside any camera's gamut
        scale = np.where(saturation > DARKEST, wide / np.maximum(saturation, DARKEST), 1.0)
        return level[..., None] + self._turned(level, scale[..., None] * chroma, back=True)

    def _split(self, linear: ArrayLike) -> tuple[Array, Array]:
        """Y (…) and c (…, 3)."""
        p = np.asarray(linear, dtype=np.float64)
        level: Array = np.maximum(p @ np.asarray(self.signal), DARKEST)
        return level, p - level[..., None]

    def _saturation(self, level: Array, chroma: Array) -> Array:
        """How far c reaches to the faces of the RGB cube: 0 neutral, 1 on a face.

        The 6-norm over the faces stands in for the maximum: smooth, and never below it. Linear along each ray. The
        upper faces open by 0.35 Y⁴ near white, so that light, nearly neutral colours need not move. A bright saturated
        colour may pass 1 there and is clipped by the response, as in a real camera.
        """
        room = np.maximum(1 - level + 0.35 * level**4, 0.05)
        down, up = np.maximum(-chroma, 0) / level[..., None], np.maximum(chroma, 0) / room[..., None]
        squares = down * down + up * up  # only one of the two is not 0
        return np.asarray(np.cbrt(np.sqrt((squares * squares * squares).sum(axis=-1))))

    def _curve(self, saturation: Array) -> Array:
        """Boost beyond the onset, then compress beyond the knee towards 1; increasing, C²."""
        over = np.maximum(saturation - self.onset, 0)
        boosted = saturation + self.boost * over**3 / (over**2 + 0.1)
        z = np.maximum(boosted - self.knee, 0) / (1 - self.knee)
        return np.minimum(boosted, self.knee) + (1 - self.knee) * z / (1 + z**1.5) ** (1 / 1.5)

    def _turned(self, level: Array, chroma: Array, back: bool = False) -> Array:
        """Chroma turned in the plane w·c = 0, the more the further it lies from grey; or turned back."""
        if self.turn == 0 and self.bend == 0:
            return chroma
        _, _, rows = np.linalg.svd(np.asarray(self.signal)[None, :])
        plane = np.ascontiguousarray(rows[1:].T)  # an orthonormal basis (3, 2)
        u, v = np.moveaxis(chroma @ plane, -1, 0)
        radius, angle = np.hypot(u, v), np.arctan2(v, u)
        over = np.maximum(radius / (level + 0.1) - self.onset, 0)
        part = over**3 / (over**3 + 1)  # of the turn, at this radius
        if back:
            turned, angle = angle, angle - part * self.turn
            for _ in range(30):  # Newton on angle + part·(turn + bend·sin angle) = turned; slope ≥ 1 − |bend|
                wrong = angle + part * (self.turn + self.bend * np.sin(angle)) - turned
                angle = angle - wrong / (1 + part * self.bend * np.cos(angle))
        else:
            angle = angle + part * (self.turn + self.bend * np.sin(angle))
        return np.asarray(np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1) @ plane.T)


# --- The camera -------------------------------------------------------------------------------------------------------


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
