"""The physical model on cameras that it was not made on: a seeded family of simulated ones, each with its own sensor,
tone curve, gamut map, lights and chart, photographed with noise, 8-bit JPEGs and exposures off by up to 3 %.

    python -m tests.benchmarks.unseen_cameras [number of cameras] [thesis]

Printed per camera and as median and worst: the largest error of f in the range that the samples span, ‖ΔTs‖/‖Ts‖ and
the largest relative error of Tw with the multipliers unknown, ‖ΔTs‖/‖Ts‖ with them known, and on other surfaces, with
them known, the RMSE of JPEG → RAW and the mean pixel error of RAW → JPEG. The simulated D5100 and SD Merrill come
first, each style with charts of 24 and 140 patches.

What bounds them: f below the darkest grey of the shots and above the brightest is continued by EMoR, which a pure power
bends most; Tw's common factor is told by f⁻¹ of neutral values, so by as much as the channels' curves really differ
(0.4 % of a code there), it is off.
"""

import sys
from collections.abc import Mapping
from dataclasses import astuple, dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.calibration.options import PhysicalOptions, Preset
from lutforge.calibration.physical.kriging import fit_camera_model
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import fit_gamut_maps, fit_stages
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.colour.spectra import WAVELENGTHS, light
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import (
    LIGHT_OF_WHITE_BALANCE,
    SimulatedCamera,
    SimulatedGamutMap,
    SimulatedStyle,
    SimulatedWhiteBalance,
    ToneResponse,
    _fit_matrix,
    invert_increasing,
    nikon_d5100,
    sigma_sd_merrill,
)
from tests.calibration.samples_simulated import chart_140, photograph_patches, surfaces

Array = NDArray[np.float64]

LIGHTS = (2600.0, "A", 3200.0, "FL2", "FL11", "LED-B3", 4500.0, 5200.0, 5800.0, 6500.0, 7500.0, 9000.0)
"""CIE illuminants, black bodies below 4000 K and daylight above."""


@dataclass(frozen=True)
class Power:
    """f: a power with a straight toe, and a shoulder that rolls off; knee: where it begins, in encoded values."""

    exponent: float
    toe: float
    knee: float

    def _decode(self, v: Array) -> Array:
        rolled = np.where(v > self.knee, v + 2.0 * (v - self.knee) ** 2 * (1 + self.knee), v)
        bent = (rolled + self.toe) ** self.exponent - self.toe**self.exponent
        top = 1.0 + 2.0 * (1 - self.knee) ** 2 * (1 + self.knee)
        return np.asarray(bent / ((top + self.toe) ** self.exponent - self.toe**self.exponent))

    def __call__(self, linear: ArrayLike) -> Array:
        x = np.clip(linear, 0.0, 1.0)
        return np.where(x < 1, invert_increasing(self._decode, x, 0.0, 1.0), 1.0)

    def inverse(self, encoded: ArrayLike) -> Array:
        return self._decode(np.clip(encoded, 0.0, 1.0))


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
        left = 1 - np.minimum(distance, self.threshold) - over / (1 + (over / room) ** 1.5) ** (1 / 1.5)
        return np.asarray(top * left)


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


def _light(name: float | str) -> Array:
    if isinstance(name, str) or name > 4000:
        return light(name)
    metres = WAVELENGTHS * 1e-9
    spectrum = metres**-5 / np.expm1(1.4388e-2 / (metres * name))
    return np.asarray(spectrum / spectrum.max())


def _sensor(rng: np.random.Generator) -> Array:
    """A mixture of two measured sensors, its filters shifted, widened and leaking into each other."""
    share = rng.uniform(-0.1, 1.1)
    mixed = share * nikon_d5100().sensitivity + (1 - share) * sigma_sd_merrill().sensitivity
    filters = np.maximum(mixed / mixed.max(axis=0), 0.0)
    shifted = [
        np.interp(550 + (WAVELENGTHS - 550 - rng.normal(0, 5)) / rng.uniform(0.93, 1.07), WAVELENGTHS, filters[:, c])
        for c in range(3)
    ]
    leak = np.eye(3) + rng.uniform(0, 0.08, (3, 3))
    return np.column_stack(shifted) @ leak * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))


def _response(rng: np.random.Generator) -> ToneResponse | Power | Logarithm:
    kind = rng.integers(3)
    if kind == 0:
        toe, shoulder = rng.uniform(0.15, 0.3), rng.uniform(0.85, 0.97)
        return ToneResponse(tuple(toe + rng.normal(0, 0.004, 3)), tuple(shoulder + rng.normal(0, 0.004, 3)))
    if kind == 1:
        return Power(rng.uniform(1.8, 2.4), rng.uniform(0.02, 0.06), rng.uniform(0.6, 0.9))
    return Logarithm(rng.uniform(15, 80))


def _gamut_map(rng: np.random.Generator, matrix: Array) -> SimulatedGamutMap | DistanceMap:
    if rng.integers(3) == 0:
        return DistanceMap(rng.uniform(0.4, 0.6), rng.uniform(0.0, 0.7))
    signal = np.array([0.25, 0.5, 0.25]) @ np.linalg.inv(matrix)
    return SimulatedGamutMap(
        tuple(signal),
        rng.uniform(0.55, 0.75),
        rng.uniform(0.4, 0.5),
        rng.uniform(0, 0.9),
        rng.normal(0, 0.07),
        rng.uniform(-0.15, 0.15),
    )


def unseen_camera(seed: int) -> UnseenCamera:
    """The camera of a seed."""
    rng = np.random.default_rng([seed, 404])
    sensitivity = _sensor(rng)
    matrix = _fit_matrix(sensitivity)
    lights = {f"wb{place}": _light(LIGHTS[name]) for place, name in enumerate(sorted(rng.permutation(len(LIGHTS))[:4]))}
    balances = {}
    for name, spectrum in lights.items():
        r, g, b = spectrum @ sensitivity
        balances[name] = SimulatedWhiteBalance((g / r, 1.0, g / b), 5000.0)
    h, f = _gamut_map(rng, matrix), _response(rng)
    style = SimulatedStyle("standard", h, f)  # type: ignore[arg-type]  # any h and f that can be called
    return UnseenCamera(
        "LutForge",
        f"Unseen {seed}",
        sensitivity,
        matrix,
        balances,
        {"standard": style},
        full_well=rng.uniform(15_000, 60_000),
        lights=lights,
        patches=int(rng.choice((24, 140, 280))),
    )


def simulated(base: SimulatedCamera, style: str, patches: int) -> UnseenCamera:
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


@dataclass(frozen=True)
class Errors:
    """What is printed, in that order."""

    f: float
    ts_unknown: float
    tw: float
    ts: float
    raw: float
    render: float


def photographed(camera: UnseenCamera, known: bool, seed: int) -> SampleSet:
    """Samples of its chart under its lights, none of them clipped; known: with the multipliers."""
    chart = chart_140() if camera.patches <= 140 else np.vstack([chart_140(), surfaces(camera.patches - 140, 5)])
    samples = photograph_patches(camera, chart[: camera.patches], balances=tuple(camera.lights), known=known, seed=seed)
    return samples.select(unclipped(samples, _truth(camera, samples)))


def _truth(camera: UnseenCamera, samples: SampleSet) -> Array:
    return np.array([camera.multipliers(str(name)) for name in samples.white_balance])


def response_error(camera: UnseenCamera, response: Response, encoded: Array) -> float:
    """Largest error of f in the range of the samples."""
    worst = 0.0
    for c in range(3):
        codes = np.tile(np.linspace(encoded[:, c].min(), encoded[:, c].max(), 500)[:, None], 3)
        linear = camera.styles["standard"].response.inverse(codes)
        worst = max(worst, float(np.abs(response.encode(linear) - codes)[:, c].max()))
    return worst


def measure(camera: UnseenCamera, preset: Preset = "lutforge", seed: int = 0) -> Errors:
    """All errors of one camera."""
    samples = photographed(camera, known=False, seed=seed)
    start, _ = complete_multipliers(samples)
    stages = fit_stages(samples, start, np.zeros(len(samples), dtype=np.bool_), preset)
    ts_unknown = _matrix_error(camera, stages.matrix)
    tw = float(np.abs(stages.multipliers / _truth(camera, samples) - 1).max())
    samples = photographed(camera, known=True, seed=seed)
    stages = fit_stages(samples, samples.wb, np.ones(len(samples), dtype=np.bool_), preset)
    response, balanced = stages.responses["standard"], samples.raw * samples.wb
    lights = tuple(camera.lights)
    if preset == "thesis":
        physical = PhysicalOptions()
        model = fit_gamut_maps(balanced, samples.srgb, samples.shot, stages.matrix, response, lights, physical)
    else:
        model = fit_camera_model(MatrixAndResponse(stages.matrix, response), balanced, samples.srgb, lights)
    others = photograph_patches(camera, surfaces(300, 99), balances=tuple(camera.lights), exposure_error=0.0, seed=5)
    others = others.select(unclipped(others, others.wb))
    back = model.linearize(others.srgb) / others.wb - others.raw
    rendered = model.render(others.raw * others.wb)
    return Errors(
        response_error(camera, response, samples.srgb),
        ts_unknown,
        tw,
        _matrix_error(camera, stages.matrix),
        float(np.sqrt(np.mean(back**2))),
        float(np.linalg.norm(rendered - others.srgb, axis=1).mean()),
    )


def _matrix_error(camera: UnseenCamera, matrix: Array) -> float:
    return float(np.linalg.norm(matrix - camera.matrix) / np.linalg.norm(camera.matrix))


def _line(name: str, values: tuple[float, ...]) -> str:
    f, ts_unknown, tw, ts, raw, rendered = values
    percent = "".join(f"{100 * value:10.2f}" for value in (ts_unknown, tw, ts))
    return f"{name:44s}{f:8.4f}{percent}{raw:10.4f}{rendered:10.4f}"


def main() -> None:
    """Print the table."""
    words = sys.argv[1:]
    preset: Preset = "thesis" if "thesis" in words else "lutforge"
    count = next((int(word) for word in words if word.isdigit()), 12)
    cameras = [
        simulated(base, style, patches)
        for base in (nikon_d5100(), sigma_sd_merrill())
        for style in ("standard", "vivid", "landscape")
        for patches in (24, 140)
    ]
    cameras += [unseen_camera(seed) for seed in range(count)]
    print(f"{'':44s}{'f':>8s}{'Ts %':>10s}{'Tw %':>10s}{'Ts known':>10s}{'RAW':>10s}{'render':>10s}")
    rows = []
    for camera in cameras:
        rows.append(astuple(measure(camera, preset)))
        style = camera.styles["standard"]
        kind = f"{type(style.response).__name__}, {type(style.gamut_map).__name__}, {camera.patches}"
        print(_line(f"{camera.model}: {kind}", rows[-1]), flush=True)
    for name, values in (("median", np.median(rows, axis=0)), ("worst", np.max(rows, axis=0))):
        print(_line(name, tuple(values)))


if __name__ == "__main__":
    main()
