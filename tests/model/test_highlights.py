"""White in the source ends neutral under other settings, and one code of the source decides nothing."""

from collections.abc import Callable
from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.luts.bake import bake_steps
from lutforge.model.camera_profile import ModelName
from lutforge.model.highlights import clipped, white_as_grey
from lutforge.model.lattice import Lattice, grid, uniform_levels
from tests.cases.profiles import GAMMA, MATRIX, small_profile

TINTS = ((0, 0, 0), (0, 0, -1), (0, -4, -9), (-9, -4, 0), (-4, 0, -4), (0, -6, 0), (0, -20, -40), (-40, -20, 0))


def fine_profile() -> lf.CameraProfile:
    """The small profile with lattices fine enough for its matrix and response."""
    profile = small_profile()
    levels, even = (np.linspace(0.0, 1.0, 25) ** 2,) * 3, uniform_levels(25)
    render = Lattice(levels, np.clip(grid(levels) @ MATRIX.T, 0.0, 1.0) ** (1 / GAMMA))
    linearize = Lattice(even, (grid(even) ** GAMMA) @ np.linalg.inv(MATRIX).T, "tetrahedral")
    style = replace(profile.styles["standard"], render=render, linearize=linearize, coverage={})
    return replace(profile, styles={"standard": style})


def ramps() -> list[Array]:
    """Greys and tints from code 200 to 255 in steps of one code, each (56, 3)."""
    return [np.clip(np.arange(200, 256)[:, None] + np.array(tint), 0, 255) / 255 for tint in TINTS]


def codes(function: Callable[[Array], Array], colours: Array) -> Array:
    """What a function makes of colours, in codes."""
    return np.asarray(255 * np.clip(function(colours), 0.0, 1.0))


def largest_step(values: Array) -> float:
    """The largest change of a channel from one colour to the next."""
    return float(np.abs(np.diff(values, axis=0)).max())


@pytest.mark.parametrize("ev", [-1.0, 0.0, 0.7])
@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_one_code_of_the_source_moves_no_channel_by_more_than_eight(ev: float, model: ModelName) -> None:
    profile = fine_profile()
    for source, target in permutations(("standard/daylight", "standard/tungsten", "standard/auto"), 2):
        refinish = profile.refinish(source, target, ev, model)
        bare = profile.refinish(source, target, ev, model, neutral_highlights=False)
        for ramp in ramps():
            made, without = codes(refinish, ramp), codes(bare, ramp)
            bound = max(8.0, largest_step(without))  # the rendering itself may be steeper
            assert largest_step(made) <= bound, (source, target, ramp[-1])
            if model == "rbf":  # whose matrix and response are the rendering, exactly
                assert (without - made).max() <= 1.0  # no channel is darker
        assert np.ptp(codes(refinish, np.ones((1, 3)))) <= 2.0, (source, target)


def test_what_is_far_from_white_is_what_the_model_says() -> None:
    profile = small_profile()
    refinish = profile.refinish("standard/tungsten", "standard/daylight", 0.7)
    bare = profile.refinish("standard/tungsten", "standard/daylight", 0.7, neutral_highlights=False)
    colours = np.random.default_rng(0).uniform(0.02, 0.95, (500, 3))
    colours[:, 1] = np.minimum(colours[:, 1], 0.6)
    np.testing.assert_allclose(refinish(colours), bare(colours), atol=1e-12)
    assert np.ptp(codes(bare, np.ones((1, 3)))) > 10.0


def test_a_code_at_either_end_is_clipped() -> None:
    ends = np.array([[255, 40, 40], [254, 40, 40], [0, 10, 20], [1, 254, 128], [3, 255, 3]]) / 255
    np.testing.assert_array_equal(clipped(ends), [True, False, True, False, True])


def test_files_follow_near_white() -> None:
    """The steps of a process list on average within a quarter of a code, one cube behind a shaper within one."""
    beside = np.concatenate(ramps())
    for ev in (-1.0, 0.0, 0.7):
        refinish = small_profile().refinish("standard/tungsten", "standard/daylight", ev)
        made = codes(refinish, beside)
        assert np.abs(codes(bake_steps(refinish), beside) - made).mean() <= 0.25
        assert np.abs(codes(lf.bake(refinish, form="shaper", size=65), beside) - made).mean() <= 1.0


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
