"""Neutral highlights: no single code of the source decides, and colours far from white stay."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.model.camera_profile import MODELS, ModelName
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.neutral_highlights import white_as_grey
from lutforge.model.published_model import read_published_model
from lutforge.samples.clipping import clipped
from tests.cases.profiles import GAMMA, MATRIX, small_profile

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
@pytest.mark.parametrize("model", MODELS)
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


@pytest.mark.parametrize("model", MODELS)
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
