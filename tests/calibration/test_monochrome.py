"""Black-and-white picture styles: the simulated camera's rendering turned to its luma."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import style_data
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100
from lutforge.thesis.options import ThesisOptions
from tests.cases.samples import chart_140, photograph_patches

CAMERA = nikon_d5100()
LUMA = np.array([0.299, 0.587, 0.114])  # of the Y'CbCr of JPEG (ITU-R BT.601)
GREYS = np.repeat(np.linspace(0.0, 1.0, 256)[:, None], 3, axis=1)
STYLE = "standard/daylight"


def _samples() -> SampleSet:
    return photograph_patches(CAMERA, chart_140()[:80], balances=("daylight",), stops=(-2, -1, 0, 1))


def _without_colour(samples: SampleSet) -> SampleSet:
    return replace(samples, srgb=np.repeat((samples.srgb @ LUMA)[:, None], 3, axis=1))


def _monochrome(samples: SampleSet) -> bool:
    return style_data(samples, samples.wb)[0]["standard"].monochrome


@pytest.fixture(scope="module")
def profile() -> CameraProfile:
    return calibrate(_without_colour(_samples()))


def test_the_style_is_named_and_its_colour_error_left_out(profile: CameraProfile) -> None:
    assert (
        'style "standard" is black and white: its JPEGs hold no colour, so linearize gives neutral light of the same '
        "brightness"
    ) in profile.notes
    assert not any("one hue" in note or "shoot a colour chart" in note for note in profile.notes)
    assert set(profile.styles["standard"].errors) == {"render_mean", "render_max", "render_de00_mean"}


def test_greys_become_neutral_rising_light_and_come_back(profile: CameraProfile) -> None:
    raw = profile.linearize(STYLE)(GREYS)
    light = raw * profile.multipliers(STYLE)
    np.testing.assert_allclose(light, np.repeat(light[:, 1:2], 3, axis=1), atol=1e-12)
    assert np.all(np.diff(light, axis=0) > 0)
    back = profile.render(STYLE)(raw)
    assert 255 * np.abs(back - GREYS).max() < 1
    np.testing.assert_array_equal(light[0], 0.0)
    np.testing.assert_allclose(back[[0, -1]], GREYS[[0, -1]], atol=1e-12)


def test_the_light_of_a_grey_is_the_cameras(profile: CameraProfile) -> None:
    light = np.repeat(np.linspace(0.02, 0.7, 50)[:, None], 3, axis=1)
    code = CAMERA.render(light / CAMERA.multipliers("daylight"), "standard", "daylight") @ LUMA
    found = profile.linearize(STYLE)(np.repeat(code[:, None], 3, axis=1)) * profile.multipliers(STYLE)
    assert np.abs(found / light - 1).mean() < 0.05


def test_colour_and_greys_alone_are_no_monochrome_style() -> None:
    samples = _samples()
    assert _monochrome(_without_colour(samples))
    assert not _monochrome(samples)
    chart = np.tile(chart_140()[20:24], (5, 1))
    greys = photograph_patches(CAMERA, chart, balances=("daylight",), stops=(-6, -3, -1, 0))
    assert not _monochrome(greys)
    assert not _monochrome(_without_colour(greys))


def test_the_camera_model_and_the_matrix_are_those_of_the_colourful_styles() -> None:
    options = CalibrationOptions(size=5, nonuniform=False)
    colourful = photograph_patches(CAMERA, chart_140()[:60], balances=("daylight",), stops=(0,))  # one shot: no refits
    grey = _without_colour(photograph_patches(CAMERA, chart_140(), balances=("daylight",), stops=(0,)))
    grey = replace(grey, style=np.full(len(grey), "monochrome"))
    both, alone = calibrate(concatenate([colourful, grey]), options), calibrate(colourful, options)
    np.testing.assert_array_equal(both.matrix, alone.matrix)
    assert both.styles["standard"].models
    assert not both.styles["monochrome"].models
    by_thesis = calibrate(grey, ThesisOptions(size=5, nonuniform=False))
    assert any('"monochrome" is black and white' in note for note in by_thesis.notes)
