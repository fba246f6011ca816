"""Cameras whose truth is known: measured sensitivities, reflectances and lights, and a rendering of two styles.

Two thirds of the renderings are made up, drawn from a seed: a response of EMoR's curves, a matrix from the camera's own
sensitivities, and a gamut map that compresses chroma by hue and lightness, twists hues, treats skin or sky apart,
clips hard or softly, and tones shadows or highlights. The others are the published models of the Nikon D40 on other
sensors. Half of the cameras are there to choose on and half to report on; none ever changes sides.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

import lutforge as lf
from lutforge.arrays import Array, Mask
from lutforge.colour.spectra import chart_reflectances, light, linear_srgb_under
from lutforge.model.profile import CameraModel
from lutforge.model.published_model import read_published_model
from lutforge.samples.sample_set import concatenate
from tests.cases.real_data import sensors, spectral_data

Half = Literal["choose", "report"]
Sampling = Literal["charts", "casual", "one chart"]
Render = Callable[[Array], Array]

LIGHTS: Mapping[str, float | str] = {
    "tungsten": "A", "fluorescent": "FL2", "daylight": 5200.0, "cloudy": 6000.0, "shade": 7500.0
}  # fmt: skip
"""The white balances of each camera, and the lights that they are made for."""
STYLES = ("standard", "vivid")
PIXELS = 25
"""Pixels that the mean of a sample is taken over."""
READ_NOISE, FULL_WELL = 4.0, 20_000.0
"""Of the sensors, in electrons."""
JPEG_ERROR = (1.0, 0.2)
"""Standard deviation in codes of what JPEG compression adds to a pixel, and to all pixels of a sample alike."""
NEAR = 0.03
"""Farthest distance, in linear sRGB, from a colour that the published model was measured at."""


LUMA = np.array([0.2126, 0.7152, 0.0722])
AXES = np.array([[2.0, -1.0, -1.0], [0.0, np.sqrt(3.0), -np.sqrt(3.0)]]) / np.sqrt(6.0)
"""Two orthonormal axes across grey: hue is the angle in their plane, 0 at red."""


@cache
def emor(data: Path) -> tuple[Array, Array]:
    """The mean response (1024,) of real films and cameras, and their basis curves (25, 1024)."""
    blocks: list[list[float]] = []
    for line in (data / "emor" / "emor.txt").read_text(encoding="ascii").splitlines():
        if "=" in line:
            blocks.append([])
            line = line.split("=")[1]
        if blocks:
            blocks[-1] += [float(word) for word in line.split()]
    curves = np.array(blocks)
    return curves[1], curves[2:]


def made_up_response(rng: np.random.Generator, data: Path, contrast: float) -> Array:
    """A curve (1024,) at even linear values, from 0 to 1: with or without a toe, with a soft or hard shoulder."""
    mean, basis = emor(data)
    toe, shoulder = rng.choice([0.0, 0.25]) * contrast, rng.choice([0.0, 0.35])
    while True:
        curve = mean + np.array([1.5, 0.7, 0.4]) * rng.normal(size=3) @ basis[:3]
        if np.diff(curve).min() > 0 and 0.35 < curve[184] < 0.6:  # middle grey, 0.18
            break
    curve = np.clip(curve, 0.0, 1.0)
    curve = curve ** (1.0 + toe * (1.0 - curve))
    return np.asarray(1.0 - (1.0 - curve) ** (1.0 + shoulder * curve))


@dataclass(frozen=True, eq=False)
class MadeUpRendering:
    """A gamut map and a response of a made-up style.

    saturation: of all chroma; by_hue, twist: amplitudes and phases (2, 2) of the first two harmonics of the hue;
    by_lightness, fading: how much lightness and highlights take off; apart: hue, turn and gain of the colours that are
    treated apart; softness: of the clip below, 0 where it is hard; tint: (3,), of shadows or highlights.
    """

    curve: Array
    saturation: float
    by_hue: Array
    twist: Array
    by_lightness: float
    fading: float
    knee: float
    apart: tuple[float, float, float]
    softness: float
    tint: Array
    tints_highlights: bool

    @classmethod
    def drawn(cls, seed: int, style: str, data: Path) -> "MadeUpRendering":
        """A rendering of a seed; a vivid style has more contrast and chroma."""
        rng, vivid = np.random.default_rng([seed, STYLES.index(style)]), style == "vivid"
        hues = rng.uniform(0, 2 * np.pi, (2, 2))
        toned = rng.random() < 0.3
        return cls(
            made_up_response(rng, data, 1.5 if vivid else 1.0),
            rng.uniform(1.1, 1.3) if vivid else rng.uniform(0.9, 1.1),
            np.stack([rng.uniform(0.03, 0.1, 2), hues[0]]),
            np.stack([rng.uniform(0.03, 0.1, 2), hues[1]]),
            rng.uniform(0.0, 0.3),
            rng.uniform(0.0, 0.3),
            rng.uniform(0.7, 1.2),
            (np.radians(rng.choice([20.0, 220.0])), rng.uniform(-0.12, 0.12), rng.uniform(-0.15, 0.15)),
            rng.choice([0.0, 0.08]),
            -rng.uniform(0.0, 0.05, 3) * toned,
            rng.random() < 0.5,
        )

    def __call__(self, linear: Array) -> Array:
        """Linear sRGB (n, 3) → encoded (n, 3)."""
        lightness = np.clip(linear @ LUMA, 0.0, 1.0)[:, None]
        chroma = linear @ AXES.T
        size = np.linalg.norm(chroma, axis=1, keepdims=True) / np.maximum(linear.max(axis=1, keepdims=True), 1e-6)
        hue = np.arctan2(chroma[:, 1:], chroma[:, :1])

        def waves(amplitudes: Array) -> Array:
            return np.asarray(sum(a * np.cos((k + 1) * hue + b) for k, (a, b) in enumerate(amplitudes.T)))

        at, turn, gain = self.apart
        near = np.exp(-((np.angle(np.exp(1j * (hue - at))) / 0.35) ** 2)) * np.minimum(size, 0.5)
        scale = self.saturation * (1 + np.minimum(size, 1.0) * waves(self.by_hue) + gain * near)
        scale = scale * (1 - self.by_lightness * (lightness - 0.5)) * (1 - self.fading * lightness**2)
        scale = scale / (1 + (scale * size / self.knee) ** 4) ** 0.25 / (1 + 0.05 * size)
        angle = np.minimum(size, 1.0) * waves(self.twist) + turn * near
        cos, sin = np.cos(angle), np.sin(angle)
        turned = scale * np.hstack(
            [cos * chroma[:, :1] - sin * chroma[:, 1:], sin * chroma[:, :1] + cos * chroma[:, 1:]]
        )
        mapped = turned @ AXES
        mapped += (linear @ LUMA - mapped @ LUMA)[:, None]
        if self.softness:  # a hyperbola that goes to 0 below, and leaves the largest channel as it is
            least = self.softness * np.maximum(mapped.max(axis=1, keepdims=True), 1e-9)
            soft = (mapped + np.sqrt(mapped**2 + 4 * least**2)) / 2
            mapped = soft / ((1 + np.sqrt(1 + 4 * self.softness**2)) / 2)
        mapped *= 1 + self.tint * (lightness if self.tints_highlights else 1 - lightness) ** 3
        return np.asarray(np.interp(mapped, np.linspace(0, 1, 1024), self.curve))


@dataclass(frozen=True)
class FleetCamera:
    """A camera by name of its sensor. seed: of its made-up rendering; 0 where it has that of the Nikon D40.

    vignetting: stops in the corners that its JPEGs are brighter by. data: the folder of real data.
    """

    name: str
    half: Half
    seed: int
    sampling: Sampling
    vignetting: float
    data: Path

    @cached_property
    def sensitivities(self) -> Array:
        """(L, 3)."""
        return all_sensors(self.data)[self.name]

    def expose(self, reflectances: Array, of: str) -> Array:
        """RAW (n, 3) of reflectances (n, L) in the light of a white balance; a diffuser's largest channel is 1."""
        weights = self.sensitivities * light(LIGHTS[of])[:, None]
        return np.asarray(reflectances @ weights / weights.sum(axis=0).max())

    @cached_property
    def balances(self) -> dict[str, Array]:
        """Multipliers times gains (3,) by white balance: none is below 1, so that a saturated sensor is white."""
        rng, factors = np.random.default_rng([len(self.name), self.seed, 3]), {}
        for name in LIGHTS:
            r, g, b = self.expose(np.ones((1, 81)), name)[0]
            multipliers = np.array([g / r, 1.0, g / b])
            factors[name] = multipliers / multipliers.min() * rng.uniform(1.0, 1.12)
        return factors

    @cached_property
    def matrix(self) -> Array:
        """From white-balanced RAW to linear sRGB (3, 3), fitted to reflectances in daylight; rows sum to 1."""
        surfaces = all_reflectances(self.data)
        raw, white = self.expose(surfaces, "daylight"), self.expose(np.ones((1, 81)), "daylight")[0]
        fitted = np.linalg.lstsq(raw / white, linear_srgb_under(surfaces, light(LIGHTS["daylight"])), rcond=None)[0].T
        return np.asarray(fitted / fitted.sum(axis=1, keepdims=True))

    @cached_property
    def _published(self) -> dict[str, tuple[Render, cKDTree]]:
        styles: dict[str, tuple[Render, cKDTree]] = {}
        for style, folder in zip(STYLES, ("other_white_balances", "fluorescent"), strict=True):
            model = read_published_model(self.data / "nus_nikon_d40" / folder)
            styles[style] = (partial(_through, model.model), cKDTree(model.linear))
        return styles

    @cached_property
    def _made_up(self) -> dict[str, MadeUpRendering]:
        return {style: MadeUpRendering.drawn(self.seed, style, self.data) for style in STYLES}

    def render(self, raw: Array, style: str, balance: str) -> Array:
        """RAW (n, 3) → what a JPEG would hold without rounding (n, 3)."""
        linear = np.clip(raw * self.balances[balance], 0.0, 1.0) @ self.matrix.T
        made = self._made_up[style](linear) if self.seed else self._published[style][0](linear)
        return np.clip(made, 0.0, 1.0)

    def known(self, raw: Array, style: str, balance: str) -> Mask:
        """Where (n,) the rendering is what a camera does: near to measured colours, of the published models."""
        if self.seed:
            return np.ones(len(raw), dtype=bool)
        linear = np.clip(raw * self.balances[balance], 0.0, 1.0) @ self.matrix.T
        return np.asarray(self._published[style][1].query(linear)[0] < NEAR)

    def samples(self) -> lf.SampleSet:
        """What a person samples: with noise, 8-bit codes, exposures that are off, and errors of JPEG compression."""
        rng, seen = np.random.default_rng([7, self.seed, len(self.name)]), training(self.data)
        parts = []
        for style in STYLES:
            for number, (balance, lit_by, level, surfaces) in enumerate(self._shots(rng, seen)):
                x, y = rng.uniform(-1, 1, (2, len(surfaces)))
                place = np.column_stack([3 * x, 2 * y]) / np.sqrt(13)
                raw = np.clip(level * self.expose(surfaces, lit_by), 0.0, None)
                brighter = 2.0 ** (self.vignetting * np.sum(place**2, axis=1))
                seen_raw, jpeg = self.sampled(rng, raw, style, balance, brighter)
                rows = self.known(raw, style, balance)
                factors = self.balances[balance]
                part = lf.SampleSet.from_arrays(
                    seen_raw[rows], jpeg[rows], camera=self.name, style=style,
                    white_balance=balance, shot=f"{style} {number}", patch=[f"{n:04d}" for n in np.flatnonzero(rows)],
                    exposure_s=level / 60, wb=factors / factors[1],
                )  # fmt: skip
                parts.append(replace(part, position=place[rows]) if self.sampling == "casual" else part)
        return concatenate(parts)

    def sampled(
        self, rng: np.random.Generator, raw: Array, style: str, balance: str, brighter: Array | None = None
    ) -> tuple[Array, Array]:
        """What a sample holds of RAW (n, 3): the means of noisy RAW pixels, and of 8-bit pixels of a JPEG, each (n, 3).

        brighter: (n,), by how much the JPEG is brighter than the RAW says, 1 unless given.
        """
        pixels = raw[:, None] + np.sqrt(raw / FULL_WELL + (READ_NOISE / FULL_WELL) ** 2)[:, None] * rng.normal(
            size=(len(raw), PIXELS, 3)
        )
        exposed = pixels if brighter is None else pixels * brighter[:, None, None]
        shown = self.render(exposed.reshape(-1, 3), style, balance).reshape(pixels.shape)
        of_pixel, of_all = JPEG_ERROR
        off = of_pixel * rng.normal(size=shown.shape) + of_all * rng.normal(size=(len(raw), 1, 3))
        inside = (shown > 0.5 / 255) & (shown < 1 - 0.5 / 255)  # what is clipped all over is coded without error
        jpeg = np.clip(np.rint(255 * shown + off * inside), 0, 255).mean(axis=1) / 255
        return np.clip(pixels, 0.0, 1.0).mean(axis=1), jpeg

    def _shots(self, rng: np.random.Generator, seen: Array) -> Iterator[tuple[str, str, float, Array]]:
        """White balance, light, exposure and reflectances of each shot of a style."""

        def off() -> float:
            return float(np.exp(rng.normal(0, 0.03)))

        names = list(LIGHTS)
        if (
            self.sampling == "charts"
        ):  # a chart of 24 patches on a wall of many colours, two exposures per white balance
            for number, level in enumerate(np.geomspace(0.06, 1.7, 10)[rng.permutation(10)]):
                wall = mixed(rng, seen, 130)
                yield names[number % 5], names[number % 5], level * off(), np.vstack([chart_reflectances(), wall])
        elif self.sampling == "casual":  # scenes in other light than the white balance is for, light and shade in them
            for balance, lit_by, level in (
                ("daylight", "daylight", 1.0),
                ("cloudy", "shade", 0.9),
                ("daylight", "tungsten", 0.8),
            ):
                yield balance, lit_by, level * off(), mixed(rng, seen, 500) * np.exp(rng.uniform(-3.0, 0.3, (500, 1)))
        else:
            yield (
                "daylight",
                "daylight",
                0.95 * off(),
                np.vstack([chart_reflectances(), seen[rng.permutation(len(seen))[:116]]]),
            )

    def unseen(self, rng: np.random.Generator, count: int, lit_by: str) -> Array:
        """RAW (count, 3) of reflectances and mixtures that no camera's samples have, at any exposure."""
        surfaces = mixed(rng, testing(self.data), count)
        return np.clip(self.expose(surfaces, lit_by) * np.exp(rng.uniform(-3.5, 0.4, (count, 1))), 0.0, 1.0)


def _through(model: CameraModel, linear: Array) -> Array:
    """Linear sRGB (n, 3) → encoded: a published model behind another camera's matrix."""
    return model.response.encode(model.gamut_map(linear))


def mixed(rng: np.random.Generator, surfaces: Array, count: int) -> Array:
    """Reflectances (count, L), one half as measured and one half mixed of two of them."""
    first, second = rng.integers(0, len(surfaces), (2, count))
    share = np.where(rng.random(count) < 0.5, 1.0, rng.random(count))[:, None]
    return np.asarray(share * surfaces[first] + (1 - share) * surfaces[second])


@cache
def all_sensors(data: Path) -> Mapping[str, Array]:
    """Measured sensitivities (L, 3) by camera."""
    return sensors(data)


@cache
def all_reflectances(data: Path) -> Array:
    """The measured reflectances (190, L)."""
    return spectral_data(data / "spectra" / "rawtoaces-data" / "training" / "training_spectral.json")[1].T


def training(data: Path) -> Array:
    """Reflectances that are photographed to calibrate with: 140 of the 190."""
    return all_reflectances(data)[np.random.default_rng(0).permutation(190)[:140]]


def testing(data: Path) -> Array:
    """The other 50."""
    return all_reflectances(data)[np.random.default_rng(0).permutation(190)[140:]]


def fleet(data: Path) -> tuple[FleetCamera, ...]:
    """The cameras, in a fixed order."""
    return tuple(
        FleetCamera(name, half, seed, sampling, vignetting, data)
        for half, rows in CAMERAS.items()
        for name, seed, sampling, vignetting in rows
    )


CAMERAS: Mapping[Half, tuple[tuple[str, int, Sampling, float], ...]] = {
    "choose": (
        ("Canon_EOS_5D_Mark_II", 0, "charts", 0.0),
        ("Sony_ILCE-7M3", 0, "casual", 0.5),
        ("Nikon_D700", 101, "charts", 0.0),
        ("Canon_EOS_R5", 102, "charts", 0.0),
        ("Fujifilm_X-T3", 103, "charts", 0.0),
        ("Sony_ILCE-6400", 104, "charts", 0.0),
        ("Nikon D90", 105, "charts", 0.0),
        ("Olympus E-PL2", 106, "charts", 0.0),
        ("Panasonic_DC-GX9", 107, "casual", 0.0),
        ("Pentax K-5", 108, "casual", 0.85),
        ("Canon 300D", 109, "one chart", 0.0),
        ("Hasselblad_L1D-20c", 110, "one chart", 0.0),
    ),
    "report": (
        ("Nikon D40", 0, "charts", 0.0),
        ("Canon_EOS_600D", 0, "casual", 0.4),
        ("Nikon_D850", 201, "charts", 0.0),
        ("Canon_EOS-1D_X_Mark_II", 202, "charts", 0.0),
        ("Fujifilm_GFX_100", 203, "charts", 0.0),
        ("Sony_ILCE-7SM3", 204, "charts", 0.0),
        ("Canon 40D", 205, "charts", 0.0),
        ("Nikon_Z_f", 206, "charts", 0.0),
        ("Canon_PowerShot_S90", 207, "casual", 0.0),
        ("SONY NEX-5N", 208, "casual", 0.8),
        ("Pentax Q", 209, "one chart", 0.0),
        ("Sony_DSC-RX100M4", 210, "one chart", 0.0),
    ),
}  # fmt: skip
"""Sensor, seed of the rendering (0: that of the Nikon D40), sampling, and vignetting in stops."""
