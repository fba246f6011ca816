"""Samples that cannot tell a camera: one clear line that says what to shoot, never a silently wrong profile."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions, Preset
from lutforge.calibration.style import unclipped
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import evaluate
from lutforge.model.camera_profile import ModelName
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.samples import chart_140, photograph_patches

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
@pytest.mark.parametrize("clipped", ["JPEG white", "JPEG black", "RAW"])
def test_all_clipped(model: ModelName, clipped: str) -> None:
    samples, ends = _shots(0), np.full((60, 3), float(clipped != "JPEG black"))
    samples = replace(samples, raw=ends) if clipped == "RAW" else replace(samples, srgb=ends)
    message = _refusal(samples, _options(model))
    assert "0 unclipped samples" in message and "add shots" in message


def test_one_colour_many_times_is_one_sample() -> None:
    samples = _shots(0)
    assert "1 unclipped samples of different" in _refusal(samples.select(np.full(200, 20)), _options("lattice"))


def _notes(samples: SampleSet, model: ModelName) -> str:
    return "; ".join(calibrate(samples, _options(model)).notes)


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_a_style_of_too_few_samples_is_left_out_of_the_others_profile(model: ModelName) -> None:
    samples = _shots(-1, 0, 1)
    other = samples.select(np.flatnonzero(unclipped(samples, samples.wb))[:9])
    both = concatenate([samples, replace(other, style=np.full(9, "vivid"), shot=np.full(9, "V.dng"))])
    profile, alone = calibrate(both, _options(model)), calibrate(samples, _options(model))
    assert list(profile.styles) == ["standard"]
    np.testing.assert_array_equal(profile.matrix, alone.matrix)
    assert any('style "vivid": 9 unclipped samples' in note and "left out" in note for note in profile.notes)
    found = evaluate(profile, both)
    assert any("vivid" in note and "not in the profile" in note for note in found.notes)


def test_no_unsaturated_colours() -> None:
    samples = _shots(-1, 0)
    strong = samples.select(samples.srgb.min(axis=1) < 0.4 * samples.srgb.max(axis=1))
    message = _refusal(strong, _options("rbf"))
    assert "unsaturated" in message and "grey card" in message
    notes = _notes(strong, "lattice")  # a lattice of these colours can be had, but not silently
    assert "unsaturated" in notes and "grey card" in notes


def test_shots_without_bright_colours_are_named() -> None:
    assert "brighter tones are guessed" in _notes(_shots(-4, -3), "lattice")
    assert "brighter" not in _notes(_shots(-1, 0, 1), "lattice")


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_one_exposure_only(model: ModelName) -> None:
    samples = _shots(0)
    if model == "rbf":
        assert "several shutter speeds" in _refusal(samples, _options(model, "thesis"))
    notes = _notes(samples, model)  # RAW tells the response, so it can be done, but says so
    assert "one exposure only: shoot the same at" in notes and "one shot only" in notes


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_two_contradicting_shots(model: ModelName) -> None:
    samples = _shots(-1, 0)
    bright = samples.shot == "standard daylight -1"
    lifted = np.where(bright[:, None], samples.srgb**0.6, samples.srgb)  # as if D-Lighting were on
    profile = calibrate(replace(samples, srgb=lifted), _options(model))
    assert "do not look like one camera's rendering" in str(profile.diagnoses[0])


def test_one_shot_that_contradicts_many_is_named() -> None:
    samples = _shots(-2, -1, 0, 0.5, 1)
    stray = samples.shot == "standard daylight -1"
    lifted = np.where(stray[:, None], samples.srgb**0.6, samples.srgb)
    profile = calibrate(replace(samples, srgb=lifted), _options("lattice"))
    assert any("standard daylight -1" in note and "left out" in note for note in profile.notes)
    assert not any("daylight +0" in note for note in profile.notes)


@pytest.mark.parametrize("model", ["lattice", "rbf"])
def test_a_white_balance_with_one_shot_is_named(model: ModelName) -> None:
    samples = concatenate([_shots(-1, 0), _shots(0, balances=("shade",))])
    notes = _notes(samples, model)
    assert '"shade": one shot only (standard shade +0)' in notes and "add a second" in notes


def test_an_empty_set_and_two_cameras_are_refused() -> None:
    samples = _shots(0)
    assert "0 samples" in _refusal(samples.select(np.zeros(60, dtype=np.bool_)), _options("rbf"))
    other = photograph_patches(sigma_sd_merrill(), chart_140()[:60], balances=("daylight",), stops=(0,))
    assert "one camera at a time" in _refusal(concatenate([samples, other]), _options("rbf"))


def test_a_grey_card_alone_cannot_tell_the_matrix() -> None:
    samples = photograph_patches(CAMERA, np.tile(chart_140()[20:24], (5, 1)), balances=("daylight",))
    assert "colour chart" in _refusal(samples, _options("rbf"))
    assert "all colours are grey" in _notes(samples, "lattice")


def test_samples_that_suffice_make_no_such_notes() -> None:
    notes = _notes(_shots(-1, 0), "lattice")
    assert "unsaturated" not in notes and "grey" not in notes and "one exposure" not in notes
