"""Samples of simulated cameras with noise, 8-bit JPEG values and exposure errors; what cameras of today add to them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.style import StyleData
from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.model.camera_profile import CameraProfile
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import SimulatedCamera
from lutforge.simulate.scene import palette

STYLES, SETTINGS = ("standard", "vivid"), ("tungsten", "fluorescent", "daylight", "flash", "cloudy", "shade")
BALANCES = ("tungsten", "fluorescent", "daylight", "cloudy", "shade")
PIXELS = 64
"""Pixels of a patch: JPEG values are means of so many rounded ones."""


def surfaces(count: int, seed: int) -> Array:
    """Mixtures of two measured surfaces, darker or lighter, (count, L)."""
    rng = np.random.default_rng([seed, 7])
    base = np.vstack([chart_reflectances(), surface_reflectances()])
    first, second = rng.integers(0, len(base), (2, count))
    share, level = rng.uniform(0, 1, (count, 1)), rng.uniform(0.15, 1.05, (count, 1))
    mixed: Array = np.clip(level * (share * base[first] + (1 - share) * base[second]), 0.0, 1.0)
    return mixed


def chart_140(seed: int = 0) -> Array:
    """24 chart patches and 116 more, as on a large chart."""
    return np.vstack([chart_reflectances(), surfaces(116, seed)])


def photograph_patches(
    camera: SimulatedCamera,
    reflectances: Array,
    *,
    styles: Sequence[str] = ("standard",),
    balances: Sequence[str] = BALANCES,
    stops: Sequence[float] = (-3, -2, -1, 0, 1),
    exposure_error: float = 0.03,
    known: bool = True,
    seed: int = 0,
) -> SampleSet:
    """One shot of all surfaces per style, white balance and exposure; the true exposure is off by up to the error."""
    rng = np.random.default_rng(seed)
    parts: list[SampleSet] = []
    count = len(reflectances)
    for style in styles:
        for balance in balances:
            for stop in stops:
                time = camera.nominal_exposure_s * 2.0**stop
                raw = camera.expose(reflectances, balance, time * (1 + rng.uniform(-exposure_error, exposure_error)))
                raw = np.clip(raw, 0.0, 1.0)
                noise = np.sqrt(raw / camera.full_well + (camera.read_noise / camera.full_well) ** 2)
                pixels = raw[:, None] + noise[:, None] * rng.standard_normal((count, PIXELS, 3))
                jpeg = np.rint(255 * camera.render(pixels, style, balance)).mean(axis=1) / 255
                wb = camera.multipliers(balance) if known else np.nan
                parts.append(
                    SampleSet.from_arrays(
                        np.clip(pixels, 0.0, 1.0).mean(axis=1), jpeg, camera=camera.name, style=style,
                        white_balance=balance, shot=f"{style} {balance} {stop:+g}",
                        patch=[f"{place:04d}" for place in range(count)], exposure_s=time, wb=wb,
                    )
                )  # fmt: skip
    return concatenate(parts)


def made_samples(
    count: int = 300, style: str = "standard", balance: str = "daylight", shots: Sequence[str] = ("s0", "s1", "s2")
) -> SampleSet:
    """Random colours of a made camera, whose rendering is a white balance and a power, dealt out to shots."""
    raw, gain = np.random.default_rng(4).uniform(0.02, 0.5, (count, 3)), np.array([1.8, 1.0, 1.5])
    return SampleSet.from_arrays(
        raw / gain, raw**0.45, camera="Test Cam", style=style, white_balance=balance, shot=np.resize(shots, count),
        patch=np.arange(count).astype(np.str_), exposure_s=0.01, wb=gain,
    )  # fmt: skip


def samples_of_settings(
    camera: SimulatedCamera, seed: int, styles: Sequence[str] = STYLES, balances: Sequence[str] = SETTINGS
) -> SampleSet:
    """Colours of 36 surfaces at three levels under three lights, on every setting; every other colour is of another
    "shot", so that leaving them out in turn, which costs most of a calibration, takes two fits.
    """
    parts: list[SampleSet] = []
    rng = np.random.default_rng(seed)
    for style in styles:
        for balance in balances:
            for light in (balance, "tungsten", "shade"):
                drawn = palette(36, rng)
                raw = np.clip(np.vstack([camera.expose(level * drawn, light) for level in (0.12, 0.45, 1.0)]), 0.0, 1.0)
                jpeg = camera.render(raw[:, None] + rng.normal(0, 0.002, (len(raw), 16, 3)), style, balance)
                parts.append(
                    SampleSet.from_arrays(
                        raw, np.rint(255 * jpeg).mean(axis=1) / 255, camera=camera.name, style=style,
                        white_balance=balance, shot=np.resize([f"{style} 0", f"{style} 1"], len(raw)),
                        patch=[f"{len(parts)}-{row}" for row in range(len(raw))], exposure_s=1 / 60,
                        wb=camera.white_balances[balance].multipliers,
                    )
                )  # fmt: skip
    return concatenate(parts)


def style_of(x: Array, y: Array, shots: int = 10) -> StyleData:
    """A style of samples Tw E → I, each (n, 3), dealt out to some shots."""
    shot = np.array([f"shot {row % shots}" for row in range(len(x))])
    return StyleData(x, y, shot, SampleSet.from_arrays(x, y, camera="camera", shot=shot, wb=1.0))


def spread_over_picture(samples: SampleSet, seed: int = 0) -> SampleSet:
    """Samples at places drawn evenly over pictures of 3 : 2."""
    x, y = np.random.default_rng(seed).uniform(-1, 1, (2, len(samples)))
    return replace(samples, position=np.column_stack([3 * x, 2 * y]) / np.sqrt(13))


def lost_stops(samples: SampleSet, ev: float, centre: tuple[float, float] = (0.0, 0.0), power: float = 1.0) -> Array:
    """What a lens loses at the places of samples (n,), in stops: ev · r^(2 power) around a centre, corners r = 1."""
    return np.asarray(ev * np.sum((samples.position - centre) ** 2, axis=1) ** power)


def with_dark_corners(samples: SampleSet, stops: Array) -> SampleSet:
    """The samples of a lens that loses stops (n,), which the camera corrects in the JPEG: RAW is darker."""
    return replace(samples, raw=samples.raw / 2.0 ** stops[:, None])


def with_bright_jpegs(samples: SampleSet, stops: Array, profile: CameraProfile) -> SampleSet:
    """The samples with JPEGs brighter by stops (n,), through a camera's own rendering; RAW stays as it is."""
    srgb = samples.srgb.copy()
    for name, model in profile.styles.items():
        rows = samples.style == name
        assert model.render is not None and model.linearize is not None
        brighter = 2.0 ** stops[rows, None] * model.linearize(srgb[rows])
        srgb[rows] = model.render(np.clip(brighter, 0.0, 1.0))
    return replace(samples, srgb=np.clip(srgb, 0.0, 1.0))


def with_gamma(samples: SampleSet, shots: list[str], gamma: float) -> SampleSet:
    """The samples with the JPEGs of some shots raised to a power."""
    chosen = np.isin(samples.shot, shots)
    return replace(samples, srgb=np.where(chosen[:, None], samples.srgb**gamma, samples.srgb))


def shadow_stops(samples: SampleSet, ev: float) -> Array:
    """What lifts shadows by stops: all of it in the dark, half of it at 10 % of saturation, nothing of bright tones."""
    return np.asarray(ev / (1.0 + (samples.raw.mean(axis=1) / 0.1) ** 2))


def with_scene_tone(samples: SampleSet, shots: list[str], stops: Array, camera: SimulatedCamera) -> SampleSet:
    """The samples of a camera that brightens some shots by stops (n,) before it renders them."""
    srgb = samples.srgb.copy()
    for name, shot in samples.by_shot():
        if name in shots:
            mine = samples.shot == name
            light = shot.raw * 2.0 ** stops[mine, None]
            srgb[mine] = camera.render(light, str(shot.style[0]), str(shot.white_balance[0]))
    return replace(samples, srgb=srgb)
