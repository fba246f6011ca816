"""Grey ramps and near-clipped tints rise to white, end neutral, and are alike by every way to the same picture."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.grading.baked_grades import BakedGrades, SettingChange
from lutforge.luts.bake import bake_steps
from lutforge.luts.sequence import Lut
from lutforge.luts.target import target_of
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.transform import Transform
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.check import load_config
from lutforge.ocio.config import write_config
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.profiles import small_profile
from tests.cases.samples import samples_of_settings

TINTS = ((254, 254, 254), (254, 250, 245), (245, 250, 254), (250, 254, 250), (254, 248, 254))
DEFAULT = target_of(Path("x.resolve.cube")).default  # nodes per axis of a cube for Resolve
STOPS = (0.0, -1.0, 0.0, 1.0, -2.0, 2.0)


def ramps() -> list[Array]:
    """Per tint (m, 3) colours of 8-bit codes in [0, 1] that rise until all channels are at 255."""
    light = np.arange(0.0, 275.0)[:, None]
    return [np.rint(np.minimum(light * np.array(tint) / 254, 255)) / 255 for tint in TINTS]


@dataclass(frozen=True)
class Ways:
    """One combination. fall: the largest, over ways; tint: at the top; apart: per way, from `apply`; in codes.

    bare: how far a cube of the model that does not treat white differs from that model.
    """

    name: str
    fall: float
    tint: float
    apart: dict[str, float]
    bare: float


def measured(profile: CameraProfile, folder: Path, count: int, inverse_size: int, size: int) -> Iterator[Ways]:
    """The first `count` combinations of a profile's settings, in a fixed order; `size`: of the cubes."""
    config = OCIO.Config.CreateFromFile(str(write_config([profile], folder / "config", inverse_size=inverse_size)))
    camera, grades = name_cameras([profile])[0], BakedGrades()
    named = [(style, balance) for style in profile.styles for balance in profile.white_balances]
    pairs = [(source, target) for source in named for target in named if source != target]
    np.random.default_rng(0).shuffle(pairs)
    colours, ends = np.concatenate(ramps()), np.cumsum([len(ramp) for ramp in ramps()])
    for number, (source, target) in enumerate(pairs[:count]):
        ev = STOPS[number % len(STOPS)]
        taken_as = profile.selector("/".join(source))
        wanted = profile.selector("/".join(target))
        transform = profile.refinish(taken_as, wanted, ev)
        graded = grades.refinish(SettingChange(profile, taken_as, profile, wanted, ev))
        made = {"apply": _codes(graded.processor(), colours)}
        made["clf"] = _codes(bake_steps(transform).processor(), colours)
        made["cube"] = _codes(_shaped(transform, size).processor(), colours)
        bare = profile.refinish(taken_as, wanted, ev, neutral_highlights=False)
        off = _codes(_shaped(bare, size).processor(), colours) - np.clip(bare(colours), 0.0, 1.0) * 255
        if ev == 0 and camera.reference_balance in (source[1], target[1]):  # looks are from and to it
            between = camera.jpeg(source[0], target[1])
            steps: list[OCIO.Transform] = []
            if source[1] != target[1]:
                sign, name = ("", camera.jpeg(*source)) if target[1] == camera.reference_balance else ("-", between)
                look = f"{sign}{name} → {camera.balances[camera.reference_balance]}"
                steps.append(OCIO.LookTransform(src=name, dst=name, looks=look))
            to_style = OCIO.ColorSpaceTransform(src=between, dst=camera.jpeg(*target))
            made["look"] = _codes(_processor(config, [*steps, to_style]), colours)
            if target[1] == camera.reference_balance:
                view = next(view for view in config.getViewTransformNames() if view.endswith(camera.styles[target[0]]))
                shown = OCIO.DisplayViewTransform(src=between, display="sRGB - Display", view=view)
                made["view"] = _codes(_processor(config, [*steps, shown]), colours)
        falls = [np.diff(ramp, axis=0).min() for way in made.values() for ramp in np.split(way, ends[:-1])]
        yield Ways(
            f"{'/'.join(source)} to {'/'.join(target)}, {ev:+g} EV",
            -float(min(falls)),
            max(float(np.ptp(way[ends[0] - 1])) for way in made.values()),
            {way: float(np.abs(values - made["apply"]).max()) for way, values in made.items() if way != "apply"},
            float(np.abs(off).max()),
        )


def _shaped(transform: Transform, size: int) -> Lut:
    return lf.bake(transform, form="shaper", size=size)


def _processor(config: OCIO.Config, steps: list[OCIO.Transform]) -> OCIO.CPUProcessor:
    return config.getProcessor(OCIO.GroupTransform(steps)).getDefaultCPUProcessor()


def _codes(processor: OCIO.CPUProcessor, colours: Array) -> Array:
    pixels = np.ascontiguousarray(colours, dtype=np.float32)
    processor.applyRGB(pixels)
    return np.asarray(np.clip(pixels, 0.0, 1.0) * 255, dtype=np.float64)


@pytest.mark.slow
def test_white_is_white_by_every_way(tmp_path: Path) -> None:
    found = list(measured(small_profile(), tmp_path, 12, 17, 17))
    assert any("view" in ways.apart for ways in found)
    for ways in found:
        assert ways.tint <= 2.0, ways
        assert ways.apart["clf"] <= 0.01, ways


@pytest.mark.slow
def test_a_cube_keeps_the_colours_beside_white() -> None:
    profile = small_profile()
    codes = np.full((3, 5, 3), 255)
    for channel in range(3):
        codes[channel, :, channel] = range(250, 255)
    beside = codes.reshape(-1, 3) / 255
    for source, target in permutations(("standard/daylight", "standard/tungsten", "standard/auto"), 2):
        transform = profile.refinish(profile.selector(source), profile.selector(target))
        shaped = np.clip(_shaped(transform, DEFAULT)(beside), 0.0, 1.0)
        error = 255 * np.abs(shaped - np.clip(transform(beside), 0.0, 1.0)).max()
        assert error <= 1.0, (source, target, error)


def test_white_stays_white_in_the_published_configs() -> None:
    for path in sorted((Path(__file__).parents[2] / "ocio_configs").glob("*/config.ocio")):
        config = load_config(path)
        spaces = [space.getName() for space in config.getColorSpaces()]
        names = [name for name in spaces if " JPEG standard " in name]
        assert names
        for source in names:
            for target in names:
                white = _codes(config.getProcessor(source, target).getDefaultCPUProcessor(), np.ones((1, 3)))
                assert white.min() >= 254.99, (source, target, white)


@pytest.mark.slow
@pytest.mark.parametrize("camera", [nikon_d5100(), sigma_sd_merrill()], ids=lambda camera: camera.name)
def test_ramps_of_a_calibrated_camera_rise_to_a_neutral_white(camera: SimulatedCamera, tmp_path: Path) -> None:
    profile = calibrate(samples_of_settings(camera, 1, ("standard",)), CalibrationOptions(size=17))
    for ways in measured(profile, tmp_path, 12, 33, DEFAULT):
        assert ways.fall <= 5.0, ways
        assert ways.tint <= 2.0, ways
        assert ways.apart.pop("clf") <= 0.01, ways
        # White rises within the codes from 180 on, which cubes of 33 nodes and the looks of a config round off.
        assert ways.apart.pop("cube") <= max(4.5, ways.bare) + 0.01, ways
        assert max(ways.apart.values(), default=0.0) <= 4.0, ways


@pytest.mark.slow
def test_one_code_of_a_real_camera_moves_no_channel_by_more_than_eight(s40_samples: SampleSet) -> None:
    profile = calibrate(s40_samples, CalibrationOptions(size=33))
    balances = [*profile.white_balances, "1.7,1,1.7", "2.3,1,1.1", "2.4,1,1"]
    lights = np.arange(200.0, 260.0)[:, None]
    tints = [np.array(tint) / 254 for tint in (*TINTS, (236, 246, 254))]
    rising = [np.rint(np.minimum(lights * tint, 255)) / 255 for tint in tints]
    for source, target in permutations(balances, 2):
        for ev in (-1.0, 0.0, 0.7):
            refinish = profile.refinish(f"standard/{source}", f"standard/{target}", ev)
            steps = [255 * np.abs(np.diff(np.clip(refinish(ramp), 0.0, 1.0), axis=0)).max() for ramp in rising]
            assert max(steps) <= 8.0, (source, target, ev)


@pytest.mark.slow
def test_white_of_real_photographs_is_grey_when_exposed_down(s40_samples: SampleSet) -> None:
    """The S40's automatic white balance renders neutral RAW with 5 codes too little red."""
    profile = calibrate(s40_samples, CalibrationOptions(size=17))
    for target in ("standard/1.9,1,1.3", "standard/1.8,1,1.8"):
        for ev in (-0.5, -1.0, -2.0):
            white = 255 * profile.refinish("standard/2.0,1,1.5", target, ev)(np.ones(3))
            assert np.ptp(white) <= 2.0, (target, ev, white)
