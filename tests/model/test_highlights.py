"""White in the source stays neutral under other settings; every other colour is what the model says."""

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.model.highlights import CLIPPED, clipped, neutral_where_clipped, white_as_grey
from tests.model.profiles_synthetic import small_profile


def test_white_is_raised_to_one_level_and_a_measured_colour_left_alone() -> None:
    balanced = np.array([[1.6, 1.0, 0.4], [0.7, 0.6, 0.4], [1.6, 1.0, 0.4], [0.2, 0.9, 0.1]])
    encoded = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 254 / 255, 245 / 255], [0.4, 1.0, 0.3]])
    wanted = [[1.6, 1.6, 1.6], [1.0, 1.0, 1.0], [1.6, 1.0, 0.4], [0.2, 0.9, 0.1]]
    np.testing.assert_allclose(neutral_where_clipped(encoded, balanced), wanted)
    assert clipped(encoded).all()
    np.testing.assert_allclose(neutral_where_clipped(encoded[:1], balanced[:1], white=4.0), 4.0)


def test_it_sets_in_within_half_a_code_and_leaves_all_else() -> None:
    encoded = np.linspace(0.9, 1.0, 2001)[:, None] * np.ones(3)
    balanced = encoded * [1.6, 1.0, 0.4]
    raised = neutral_where_clipped(encoded, balanced)
    assert np.all(np.diff(raised, axis=0) >= 0)
    below = encoded[:, 0] <= 1 - CLIPPED
    np.testing.assert_array_equal(raised[below], balanced[below])
    dark = neutral_where_clipped(np.zeros((1, 3)), np.array([[0.02, 0.01, 0.0]]))
    np.testing.assert_array_equal(dark, 0.0)


@pytest.mark.parametrize("ev", [0.0, 0.7])
def test_white_stays_white_in_a_refinish_and_in_its_file(ev: float) -> None:
    profile = small_profile()
    refinish = profile.refinish("standard/tungsten", "standard/daylight", ev, "rbf")
    bare = profile.refinish("standard/tungsten", "standard/daylight", ev, "rbf", neutral_highlights=False)
    assert np.ptp(bare(np.ones(3))) > 0.05
    assert np.ptp(refinish(np.ones(3))) < 0.005
    assert np.ptp(lf.bake(refinish, size=17)(np.ones(3))) < 0.01
    middle = np.random.default_rng(0).uniform(0.02, 0.95, (500, 3))
    np.testing.assert_allclose(refinish(middle), bare(middle), atol=1e-12)


def test_no_channel_of_the_output_becomes_darker_where_a_tinted_grey_becomes_white() -> None:
    """In the output's linear light, from grey to burnt-out white, under white balances that tint either way."""
    to_linear = np.array([[1.7, -0.5, -0.2], [-0.3, 1.6, -0.3], [0.0, -0.6, 1.6]])
    grey = np.linspace(0.5, 1.0, 2001)[:, None].repeat(3, axis=1)
    below = grey[:, 0] < 1 - CLIPPED
    for tint in ([2.0, 1.0, 0.5], [0.5, 1.0, 2.0], [1.0, 0.5, 1.0]):
        balanced = grey**2.2 * tint
        raised = neutral_where_clipped(grey, balanced, to_linear=to_linear)
        assert np.all((raised - balanced) @ to_linear.T >= -1e-12)
        assert np.any((neutral_where_clipped(grey, balanced) - balanced) @ to_linear.T < -0.01)
        assert np.ptp(raised[-1]) < 1e-12
        np.testing.assert_array_equal(raised[below], balanced[below])


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
