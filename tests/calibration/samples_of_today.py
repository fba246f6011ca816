"""What cameras of today do beyond a fixed rendering, put into samples: lens falloff, tone that moves with the scene."""

from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.model.camera_profile import CameraProfile
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import SimulatedCamera


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
