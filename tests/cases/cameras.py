"""Simulated cameras that nothing was made on: each with its own sensor, tone curve, gamut map, lights and chart."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.calibration.style import unclipped
from lutforge.colour.spectra import WAVELENGTHS, chart_reflectances, light, spectrum_of
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import (
    LIGHT_OF_WHITE_BALANCE,
    SimulatedCamera,
    SimulatedGamutMap,
    ToneResponse,
    _fit_matrix,
    invert_increasing,
    nikon_d5100,
    sigma_sd_merrill,
)
from tests.cases.samples import chart_140, photograph_patches, surfaces

Array = NDArray[np.float64]

LIGHTS = (
    "2600K", "A", "3200K", "FL2", "FL11", "LED-B3", "4500K", "5200K", "5800K", "6500K", "7500K", "9000K",
)  # fmt: skip


@dataclass(frozen=True)
class Power:
    """f: a power with a straight toe, and a shoulder that rolls off; knee: where it begins, in encoded values."""

    exponent: float
    toe: float
    knee: float

    def __call__(self, linear: ArrayLike) -> Array:
        x = np.clip(linear, 0.0, 1.0)
        return np.where(x < 1, invert_increasing(self.inverse, x, 0.0, 1.0), 1.0)

    def inverse(self, encoded: ArrayLike) -> Array:
        v = np.clip(encoded, 0.0, 1.0)
        rolled = np.where(v > self.knee, v + 2.0 * (v - self.knee) ** 2 * (1 + self.knee), v)
        bent = (rolled + self.toe) ** self.exponent - self.toe**self.exponent
        top = 1.0 + 2.0 * (1 - self.knee) ** 2 * (1 + self.knee)
        return np.asarray(bent / ((top + self.toe) ** self.exponent - self.toe**self.exponent))


@dataclass(frozen=True)
class Logarithm:
    """f = log(1 + a x) / log(1 + a): flat contrast over many stops."""

    strength: float

    def __call__(self, linear: ArrayLike) -> Array:
        return np.asarray(np.log1p(self.strength * np.clip(linear, 0.0, 1.0)) / np.log1p(self.strength))

    def inverse(self, encoded: ArrayLike) -> Array:
        return np.asarray(np.expm1(np.clip(encoded, 0.0, 1.0) * np.log1p(self.strength)) / self.strength)


@dataclass(frozen=True)
class DistanceMap:
    """h: distances from the largest channel, (max − c) / max, boosted and rolled off towards 1 beyond a threshold, as
    the ACES gamut compression does; below it nothing moves."""

    threshold: float
    boost: float

    def __call__(self, linear: ArrayLike) -> Array:
        p = np.asarray(linear, dtype=np.float64)
        top = np.maximum(p.max(axis=-1, keepdims=True), 1e-9)
        distance = (top - p) / top
        over = np.maximum(distance - self.threshold, 0.0)
        over = over * (1 + self.boost * over / (over + 0.1))
        room = 1 - self.threshold
        rest = 1 - np.minimum(distance, self.threshold) - over / (1 + (over / room) ** 1.5) ** (1 / 1.5)
        return np.asarray(top * rest)


@dataclass(frozen=True, eq=False)
class UnseenCamera(SimulatedCamera):
    """lights: by setting, what it is made for. patches: of its chart."""

    lights: Mapping[str, Array] = field(default_factory=dict)
    patches: int = 140

    def expose(self, reflectances: ArrayLike, white_balance: str, exposure_s: float | None = None) -> Array:
        responses = self.lights[white_balance][:, None] * self.sensitivity
        responses = responses * (0.9 / responses.sum(axis=0).max())
        times = 1.0 if exposure_s is None else exposure_s / self.nominal_exposure_s
        return np.asarray(times * (np.asarray(reflectances) @ responses))


def camera_of(
    name: str,
    sensitivity: Array,
    lights: Mapping[str, str],
    gamut_map: Callable[[Array], Array],
    response: Callable[[Array], Array],
    *,
    full_well: float = 40_000.0,
    patches: int = 140,
) -> UnseenCamera:
    """A camera of one style. sensitivity: (L, 3); lights: their names by white balance; gamut_map: h; response: f."""
    spectra = {setting: spectrum_of(words) for setting, words in lights.items()}
    balances = {}
    for setting, spectrum in spectra.items():
        r, g, b = spectrum @ sensitivity
        balances[setting] = WhiteBalance((g / r, 1.0, g / b), 5000.0)
    styles = {"standard": (gamut_map, response)}
    return UnseenCamera(
        "LutForge", name, sensitivity, _fit_matrix(sensitivity), balances,
        styles,  # type: ignore[arg-type]  # any h and f that can be called
        full_well=full_well, lights=spectra, patches=patches,
    )  # fmt: skip


def random_response(rng: np.random.Generator) -> ToneResponse | Power | Logarithm:
    """A tone curve, a power or a logarithm."""
    kind = rng.integers(3)
    if kind == 0:
        toe, shoulder = rng.uniform(0.15, 0.3), rng.uniform(0.85, 0.97)
        return ToneResponse(tuple(toe + rng.normal(0, 0.004, 3)), tuple(shoulder + rng.normal(0, 0.004, 3)))
    if kind == 1:
        return Power(rng.uniform(1.8, 2.4), rng.uniform(0.02, 0.06), rng.uniform(0.6, 0.9))
    return Logarithm(rng.uniform(15, 80))


def random_gamut_map(rng: np.random.Generator, sensitivity: Array) -> SimulatedGamutMap | DistanceMap:
    """A gamut map of one of two kinds."""
    if rng.integers(3) == 0:
        return DistanceMap(rng.uniform(0.4, 0.6), rng.uniform(0.0, 0.7))
    signal = np.array([0.25, 0.5, 0.25]) @ np.linalg.inv(_fit_matrix(sensitivity))
    return SimulatedGamutMap(
        tuple(signal),
        rng.uniform(0.55, 0.75),
        rng.uniform(0.4, 0.5),
        rng.uniform(0, 0.9),
        rng.normal(0, 0.07),
        rng.uniform(-0.15, 0.15),
    )


def unseen_camera(seed: int) -> UnseenCamera:
    """The camera of a seed: its sensor is a mixture of two measured ones, shifted, widened and with leaking filters."""
    rng = np.random.default_rng([seed, 404])
    share = rng.uniform(-0.1, 1.1)
    mixed = share * nikon_d5100().sensitivity + (1 - share) * sigma_sd_merrill().sensitivity
    filters = np.maximum(mixed / mixed.max(axis=0), 0.0)
    shifted = [
        np.interp(550 + (WAVELENGTHS - 550 - rng.normal(0, 5)) / rng.uniform(0.93, 1.07), WAVELENGTHS, filters[:, c])
        for c in range(3)
    ]
    leak = np.eye(3) + rng.uniform(0, 0.08, (3, 3))
    sensitivity = np.column_stack(shifted) @ leak * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))
    chosen = sorted(rng.permutation(len(LIGHTS))[:4])
    return camera_of(
        f"Unseen {seed}",
        sensitivity,
        {f"wb{place}": LIGHTS[index] for place, index in enumerate(chosen)},
        random_gamut_map(rng, sensitivity),
        random_response(rng),
        full_well=rng.uniform(15_000, 60_000),
        patches=int(rng.choice((24, 140, 280))),
    )


def bell(centre: float, width: float) -> Array:
    """A Gaussian over the wavelengths."""
    return np.asarray(np.exp(-0.5 * ((WAVELENGTHS - centre) / width) ** 2))


def overlapping_filters() -> UnseenCamera:
    """A hard case: filters that overlap, so that the matrix amplifies sixfold, no gamut map, a logarithm that clips."""
    filters = np.stack([0.9 * bell(590, 45), bell(545, 48) + 0.05 * bell(650, 30), 0.6 * bell(470, 40)], axis=1)
    lights = {"daylight": "5200K", "tungsten": "A", "shade": "7500K"}
    name = "Overlapping filters, log, clipped"
    return camera_of(name, filters, lights, np.asarray, Logarithm(30.0), patches=280)


def filmic_compressed() -> UnseenCamera:
    """Another: a steep filmic curve behind a vivid gamut that is compressed (as in ACES), so that what no
    sample showed is continued badly, and folds."""

    def compressed(x: Array) -> Array:
        y = x @ [0.2126, 0.7152, 0.0722]
        vivid = y[..., None] + 1.25 * (x - y[..., None])
        most = np.maximum(vivid.max(axis=-1, keepdims=True), 1e-9)
        distance, threshold, power = 1 - vivid / most, 0.55, 1.2
        scale = 1.05 / (((1 - threshold) / 1.05) ** -power - 1) ** (1 / power)
        over = np.maximum(distance - threshold, 0.0)
        less = threshold + over / (1 + (over / scale) ** power) ** (1 / power)
        return np.asarray(most * (1 - np.where(distance < threshold, distance, less)))

    def filmic(x: Array) -> Array:
        y = 1.6 * np.maximum(x, 0.0)
        tone = y * (2.51 * y + 0.03) / (y * (2.43 * y + 0.59) + 0.14)
        return np.asarray(np.clip(tone / 0.8957, 0.0, 1.0) ** 0.5)

    filters = np.stack([0.75 * (bell(595, 40) + 0.06 * bell(445, 25)), bell(545, 42), 0.65 * bell(465, 32)], axis=1)
    lights = {"daylight": "5200K", "shade": "7500K"}
    return camera_of("Filmic, compressed gamut", filters, lights, compressed, filmic, patches=280)


def one_style(base: SimulatedCamera, style: str, patches: int) -> UnseenCamera:
    """One style of a simulated camera, under its lights."""
    names = [name for name in base.white_balances if name != "flash"]
    return UnseenCamera(
        "LutForge",
        f"{base.model} {style}",
        base.sensitivity,
        base.matrix,
        {name: base.white_balances[name] for name in names},
        {"standard": base.styles[style]},
        lights={name: light(LIGHT_OF_WHITE_BALANCE[name]) for name in names},
        patches=patches,
    )


def photographed(camera: UnseenCamera, known: bool, seed: int) -> SampleSet:
    """Samples of its chart under its lights, none of them clipped; known: with the multipliers."""
    chart = chart_140() if camera.patches <= 140 else np.vstack([chart_140(), surfaces(camera.patches - 140, 5)])
    samples = photograph_patches(camera, chart[: camera.patches], balances=tuple(camera.lights), known=known, seed=seed)
    return samples.select(unclipped(samples, true_multipliers(camera, samples)))


def photographed_at_random(name: str, sensitivity: Array, seed: int) -> SampleSet:
    """Shots of a camera with measured sensitivities and a rendering drawn at random."""
    rng = np.random.default_rng([seed, 77])
    sensitivity = sensitivity / sensitivity.max(axis=0) * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))
    lights = {"tungsten": "A", "fluorescent": "FL2", "daylight": "5200K", "cloudy": "6000K", "shade": "7500K"}
    chosen = rng.permutation(list(lights))[: rng.integers(1, 6)].tolist()
    gamut_map, response = random_gamut_map(rng, sensitivity), random_response(rng)
    settings = {setting: lights[setting] for setting in chosen}
    camera = camera_of(name, sensitivity, settings, gamut_map, response, full_well=rng.uniform(15e3, 60e3))
    chart = (chart_reflectances(), chart_140(seed), surfaces(200, seed))[rng.integers(3)]
    stops = tuple(np.sort(rng.uniform(-5, 1, rng.integers(3, 7))).tolist())
    return photograph_patches(camera, chart, balances=chosen, stops=stops, seed=seed)


def true_multipliers(camera: UnseenCamera, samples: SampleSet) -> Array:
    """Those of the camera's white balances, (n, 3)."""
    return np.array([camera.multipliers(str(name)) for name in samples.white_balance])
