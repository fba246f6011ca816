"""Samples that cannot tell a camera: one clear line that says what to shoot, never a silently wrong profile."""

from dataclasses import replace

import numpy as np
import pytest
from samples_simulated import chart_140, photograph_patches

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions, Preset
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import ModelName
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill

CAMERA = nikon_d5100()


def _options(model: ModelName, preset: Preset = "lutforge") -> CalibrationOptions:
    return CalibrationOptions(model=model, preset=preset, size=5, nonuniform=False)


def _shots(*stops: float, balances: tuple[str, ...] = ("daylight",)) -> SampleSet:
    return photograph_patches(CAMERA, chart_140()[:60], balances=balances, stops=stops)


def _refusal(samples: SampleSet, options: CalibrationOptions) -> str:
    with pytest.raises(CalibrationError) as caught:
        calibrate(samples, options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_all_clipped(model: ModelName) -> None:
    samples = replace(_shots(0), srgb=np.ones((60, 3)))
    message = _refusal(samples, _options(model))
    assert "unclipped" in message and "add shots" in message


def test_no_unsaturated_colours() -> None:
    samples = _shots(-1, 0)
    strong = samples.srgb.min(axis=1) < 0.4 * samples.srgb.max(axis=1)
    message = _refusal(samples.select(strong), _options("rbf"))
    assert "unsaturated" in message and "grey card" in message


def test_one_exposure_only() -> None:
    samples = _shots(0)
    assert "several shutter speeds" in _refusal(samples, _options("rbf", "thesis"))
    profile = calibrate(samples, _options("rbf"))  # RAW tells the response, so it can be done, but says so
    assert any("one exposure only" in note for note in profile.notes)


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_two_contradicting_shots(model: ModelName) -> None:
    samples = _shots(-1, 0)
    bright = samples.shot == "standard daylight -1"
    lifted = np.where(bright[:, None], samples.srgb**0.6, samples.srgb)  # as if D-Lighting were on
    message = _refusal(replace(samples, srgb=lifted), _options(model))
    assert "contradict" in message and "manual mode" in message


def test_one_shot_that_contradicts_many_is_named() -> None:
    samples = _shots(-2, -1, 0, 0.5, 1)
    stray = samples.shot == "standard daylight -1"
    lifted = np.where(stray[:, None], samples.srgb**0.6, samples.srgb)
    profile = calibrate(replace(samples, srgb=lifted), _options("lattice"))
    assert any("standard daylight -1" in note and "leave out" in note for note in profile.notes)
    assert not any("daylight +0" in note for note in profile.notes)


def test_a_white_balance_with_one_shot_is_named() -> None:
    samples = concatenate([_shots(-1, 0), _shots(0, balances=("shade",))])
    profile = calibrate(samples, _options("lattice"))
    assert any('"shade": one shot only' in note for note in profile.notes)


def test_an_empty_set_and_two_cameras_are_refused() -> None:
    samples = _shots(0)
    assert "0 samples" in _refusal(samples.select(np.zeros(60, dtype=np.bool_)), _options("rbf"))
    other = photograph_patches(sigma_sd_merrill(), chart_140()[:60], balances=("daylight",), stops=(0,))
    assert "one camera at a time" in _refusal(concatenate([samples, other]), _options("rbf"))


def test_a_grey_card_alone_cannot_tell_the_matrix() -> None:
    samples = photograph_patches(CAMERA, np.tile(chart_140()[20:24], (5, 1)), balances=("daylight",))
    assert "colour chart" in _refusal(samples, _options("rbf"))
