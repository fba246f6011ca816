"""Scenes that are drawn for the lattice that linearizes, and what they are for: colours that no sample shows."""

import numpy as np

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.lattice.likely_scenes import likely_scenes, neutral_scenes, rendered_scenes
from lutforge.calibration.lattice.problem import LatticeProblem
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style_data import unclipped
from lutforge.simulate.camera import nikon_d5100
from tests.calibration.samples_simulated import chart_140, photograph_patches

CAMERA = nikon_d5100()


def test_scenes_are_drawn_around_those_of_samples_and_do_not_clip() -> None:
    samples = photograph_patches(CAMERA, chart_140(), balances=("daylight",), stops=(-2, -1))
    balanced = (samples.raw * samples.wb)[unclipped(samples, samples.wb)]
    scenes = likely_scenes(balanced, 5_000)
    np.testing.assert_array_equal(scenes, likely_scenes(balanced, 5_000))
    assert 3_000 < len(scenes) <= 5_000 and scenes.min() > 0.0 and scenes.max() < 1.0
    seen, drawn = np.log(balanced), np.log(scenes)
    np.testing.assert_allclose(np.median(drawn, axis=0), np.median(seen, axis=0), atol=0.2)
    assert np.all(drawn.min(axis=0) < seen.min(axis=0))
    render = calibrate(samples, CalibrationOptions(size=5)).profile.styles["standard"].render
    assert render is not None
    encoded, kept = rendered_scenes(render, balanced, 5_000)
    np.testing.assert_allclose(render(kept), encoded)
    assert encoded.min() > 0.5 / 255 and encoded.max() < 1 - 0.5 / 255


def test_strong_colours_beyond_the_samples_are_linearized_as_the_rendering_has_them() -> None:
    """Daylight on the tungsten setting: blues that a chart under the light of its setting does not show."""
    samples = photograph_patches(CAMERA, chart_140(), balances=("daylight", "tungsten"), stops=(-3, -2, -1, 0))
    profile = calibrate(samples, CalibrationOptions(size=17)).profile
    raw = CAMERA.expose(chart_140(), "daylight", 0.5 * CAMERA.nominal_exposure_s)
    blue = CAMERA.render(raw, "standard", "tungsten")
    seen = profile.linearize("standard/tungsten")(blue)
    again = profile.render("standard/tungsten")(np.clip(seen, 0.0, 1.0))
    # 0.0063 and 0.0027 from samples alone, 0.0031 and 0.0023 with λ_S chosen on these
    assert float(np.linalg.norm(again - blue, axis=1).mean()) < 0.0029
    error = np.linalg.norm((seen - raw) * CAMERA.multipliers("tungsten"), axis=1)
    assert float(error.mean()) < 0.0022


def test_near_white_both_lattices_are_of_one_mind() -> None:
    """Samples end at code 197: beyond, both lattices are guesses, which parted by 6.5 codes on these tints of grey."""
    scenes = neutral_scenes(512)
    assert scenes.min() >= 0.0 and scenes.max() <= 1.0 and np.ptp(scenes / scenes.max(), axis=1).max() < 0.2
    samples = photograph_patches(CAMERA, chart_140(), balances=("daylight",), stops=(-3, -2, -1))
    style = calibrate(samples, CalibrationOptions(size=17)).profile.styles["standard"]
    assert style.render is not None and style.linearize is not None
    light = np.arange(128.0, 255.0)[:, None] / 255
    for tint in ((1.0, 1.0, 1.0), (1.0, 0.98, 0.96), (0.97, 1.0, 0.99)):
        jpeg = light * np.array(tint)
        assert 255 * np.abs(style.render(style.linearize(jpeg)) - jpeg).max() < 1.5


def test_points_count_at_most_twice_the_samples() -> None:
    x, options = np.random.default_rng(1).random((50, 3)), CalibrationOptions(size=5)
    problem = LatticeProblem(x, x, x, np.ones(50), lambda values: values, options, False, 0.01, None)
    for count in (10, 5_000):
        points = np.random.default_rng(2).random((count, 3))
        together = problem.with_points(points, points)
        assert together.weight[50:].sum() <= 100.0 + 1e-9 and together.weight[50:].max() <= options.lattice.point_weight
        np.testing.assert_allclose(together.smoothness / problem.smoothness, together.weight.sum() / 50)
