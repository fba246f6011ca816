"""Grey ramps and near-clipped tints rise to white, end neutral, and are alike by every way to the same picture."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
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
from lutforge.luts.programs import target_of
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.highlights import clipped, white_as_grey
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.published_model import read_published_model
from lutforge.model.transform import Transform
from lutforge.ocio.cameras import name_cameras
from lutforge.ocio.check import load_config
from lutforge.ocio.config import write_config
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.profiles import GAMMA, MATRIX, small_profile
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
        given, wanted = profile.selector("/".join(source)), profile.selector("/".join(target))
        transform = profile.refinish(given, wanted, ev)
        graded = grades.refinish(SettingChange(profile, given, profile, wanted, ev))
        made = {"apply": _codes(graded.processor(), colours)}
        made["clf"] = _codes(bake_steps(transform).processor(), colours)
        made["cube"] = _codes(_shaped(transform, size).processor(), colours)
        bare = profile.refinish(given, wanted, ev, neutral_highlights=False)
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


def test_white_is_white_by_every_way(tmp_path: Path) -> None:
    found = list(measured(small_profile(), tmp_path, 12, 17, 17))
    assert any("view" in ways.apart for ways in found)
    for ways in found:
        assert ways.tint <= 2.0, ways
        assert ways.apart["clf"] <= 0.01, ways


@pytest.mark.slow
def test_a_cube_keeps_the_colours_beside_white() -> None:
    profile = small_profile()
    beside = np.array([np.where(np.arange(3) == c, code, 255) for c in range(3) for code in range(250, 255)]) / 255
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
    rising = [np.rint(np.minimum(lights * np.array(tint) / 254, 255)) / 255 for tint in (*TINTS, (236, 246, 254))]
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


# --- The stage that whitens: one code of the source decides nothing, and what is far from white stays -----------------


BRIGHT_TINTS = ((0, 0, 0), (0, 0, -1), (0, -4, -9), (-9, -4, 0), (-4, 0, -4), (0, -6, 0), (0, -20, -40), (-40, -20, 0))


def fine_profile() -> lf.CameraProfile:
    """The small profile with lattices fine enough for its matrix and response."""
    profile = small_profile()
    levels, even = (np.linspace(0.0, 1.0, 25) ** 2,) * 3, uniform_levels(25)
    render = Lattice(levels, np.clip(grid(levels) @ MATRIX.T, 0.0, 1.0) ** (1 / GAMMA))
    linearize = Lattice(even, (grid(even) ** GAMMA) @ np.linalg.inv(MATRIX).T, "tetrahedral")
    style = replace(profile.styles["standard"], render=render, linearize=linearize, coverage={})
    return replace(profile, styles={"standard": style})


def bright_ramps() -> list[Array]:
    """Greys and tints from code 200 to 255 in steps of one code, each (56, 3)."""
    return [np.clip(np.arange(200, 256)[:, None] + np.array(tint), 0, 255) / 255 for tint in BRIGHT_TINTS]


def codes(function: Callable[[Array], Array], colours: Array) -> Array:
    """What a function makes of colours, in codes."""
    return np.asarray(255 * np.clip(function(colours), 0.0, 1.0))


def largest_step(values: Array) -> float:
    """The largest change of a channel from one colour to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


@pytest.mark.parametrize("ev", [-1.0, 0.0, 0.7])
@pytest.mark.parametrize("model", ["lattice", "camera model"])
def test_one_code_of_the_source_moves_no_channel_by_more_than_eight(ev: float, model: ModelName) -> None:
    profile = fine_profile()
    for source, target in permutations(("standard/daylight", "standard/tungsten", "standard/auto"), 2):
        refinish = profile.refinish(source, target, ev, model)
        bare = profile.refinish(source, target, ev, model, neutral_highlights=False)
        for ramp in bright_ramps():
            made, without = codes(refinish, ramp), codes(bare, ramp)
            bound = max(8.0, largest_step(without))  # the rendering itself may be steeper
            assert largest_step(made) <= bound, (source, target, ramp[-1])
            if model == "model":  # whose matrix and response are the rendering, exactly
                assert (without - made).max() <= 1.0  # no channel is darker
        assert np.ptp(codes(refinish, np.ones((1, 3)))) <= 2.0, (source, target)


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_what_the_picture_does_not_show_near_white_is_what_the_model_says(model: ModelName) -> None:
    """Strong colours are bright in all channels of RAW, and have little of one channel of the picture."""
    profile, colours = fine_profile(), np.random.default_rng(0).uniform(0.0, 1.0, (3000, 3))
    colours = colours[colours.min(axis=1) < 0.65]  # lattices say what a picture shows to some codes
    for source, target in permutations(("standard/daylight", "standard/tungsten", "standard/auto"), 2):
        refinish = profile.refinish(source, target, 0.0, model)
        bare = profile.refinish(source, target, 0.0, model, neutral_highlights=False)
        np.testing.assert_allclose(refinish(colours), bare(colours), atol=1e-12)
        assert np.ptp(codes(bare, np.ones((1, 3)))) > 5.0  # so that white is changed


def test_white_leaves_the_colours_of_the_published_camera_alone(shared_data: Path) -> None:
    """All pairs of white balances on the colours that were measured, where source and target are not clipped."""
    folders = [shared_data / "nus_nikon_d40" / name for name in ("other_white_balances", "fluorescent")]
    profile = lf.import_published(folders, "Nikon D40")
    published = [read_published_model(folder) for folder in folders]
    worst = 0.0
    for source, target in permutations(profile.white_balances, 2):
        of = next(each for each in published if source in each.white_balances)
        raw = of.balanced / profile.multipliers(f"standard/{source}")
        x = np.clip(profile.render(f"standard/{source}")(raw), 0.0, 1.0)
        y = np.clip(profile.render(f"standard/{target}")(raw), 0.0, 1.0)
        both = np.column_stack([x, y])
        inside = np.all((both > 3 / 255) & (both < 252 / 255), axis=1)
        inside &= np.all(raw * profile.multipliers(f"standard/{target}") < 1.0, axis=1)
        made = np.clip(profile.refinish(f"standard/{source}", f"standard/{target}")(x[inside]), 0.0, 1.0)
        worst = max(worst, float(np.sqrt(np.mean((made - y[inside]) ** 2))))
    assert worst <= 0.0008
    cyan = profile.refinish("standard/cloudy", "standard/daylight")(np.array([81, 233, 239]) / 255)
    np.testing.assert_allclose(255 * cyan, [10, 233, 246], atol=1.5)


def test_a_code_at_either_end_is_clipped() -> None:
    ends = np.array([[255, 40, 40], [254, 40, 40], [0, 10, 20], [1, 254, 128], [3, 255, 3]]) / 255
    np.testing.assert_array_equal(clipped(ends), [True, False, True, False, True])


def test_white_exposed_down_is_what_the_camera_renders_grey() -> None:
    """A camera whose own white balance is off its multipliers', behind a matrix and a curve."""
    matrix = np.array([[1.5, -0.4, -0.1], [-0.2, 1.5, -0.3], [0.0, -0.5, 1.5]]) @ np.diag([0.95, 1.0, 1.03])

    def render(light: Array) -> Array:
        return np.asarray(np.clip(light @ matrix.T, 0.0, 1.0) ** (1 / 2.2))

    bare = np.array([0.55, 0.4, 0.3])
    for least in (0.02, 0.2, 0.5):
        light = white_as_grey(render, least * bare, least, np.eye(3))
        assert 255 * np.ptp(render(light)) < 0.1
        assert np.all(render(light) >= max(render(np.full(3, least)).max(), render(least * bare).max()) - 1e-3)
    np.testing.assert_array_equal(white_as_grey(render, bare, 1.7, np.eye(3)), 1.7)
    toned = white_as_grey(lambda light: render(light) * [1.0, 0.9, 0.7], bare, 0.5, np.eye(3))
    assert np.all(np.abs(np.log(toned / 0.55)) < 0.3)
