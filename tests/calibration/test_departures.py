"""Shots that the camera rendered otherwise than the rest are named and left out; none of a fixed camera is."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.departures import Departure, departing_shots
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.evaluation.evaluation import evaluate
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.cameras import photographed_at_random
from tests.cases.samples import (
    chart_140,
    photograph_patches,
    shadow_stops,
    spread_over_picture,
    with_gamma,
    with_scene_tone,
)

CAMERA = nikon_d5100()


def _fifteen(patches: int = 60) -> SampleSet:
    return spread_over_picture(photograph_patches(CAMERA, chart_140()[:patches], stops=(-2, -1, 0)))


def _found(samples: SampleSet) -> dict[str, Departure]:
    multipliers, _ = complete_multipliers(samples)
    return {each.shot: each for each in departing_shots(samples, multipliers, unclipped(samples, multipliers))}


def _names(samples: SampleSet) -> list[str]:
    return [str(name) for name in np.unique(samples.shot)]


def test_an_exposure_that_is_off_is_found_with_its_size() -> None:
    samples = _fifteen()
    name = _names(samples)[3]
    (departure,) = _found(with_scene_tone(samples, [name], np.full(len(samples), 0.3), CAMERA)).values()
    assert departure.shot == name
    assert departure.clear == (True, False, False)
    assert departure.values[0] == pytest.approx(0.3, abs=0.06)


def test_a_power_of_one_shot_is_found() -> None:
    samples = _fifteen()
    for name in _names(samples):
        assert list(_found(with_gamma(samples, [name], 0.93))) == [name]


def test_a_power_of_any_of_five_photographs_is_found(s40_samples: SampleSet) -> None:
    for name in _names(s40_samples):
        assert list(_found(with_gamma(s40_samples, [name], 0.85))) == [name]


def test_lifted_shadows_of_a_third_of_the_shots_are_contrast() -> None:
    samples = _fifteen()
    third = _names(samples)[::3]
    found = _found(with_scene_tone(samples, third, shadow_stops(samples, 0.5), CAMERA))
    assert sorted(found) == third
    assert all(departure.clear[1] and departure.values[1] < 0 for departure in found.values())


@pytest.mark.parametrize("seed", range(4))
def test_no_shot_of_a_fixed_camera_is_accused(seed: int) -> None:
    for camera in (CAMERA, sigma_sd_merrill()):
        assert _found(photographed_at_random(camera.name, camera.sensitivity, seed)) == {}
    assert _found(_fifteen(24 + 30 * seed)) == {}


def test_two_shots_are_not_accused() -> None:
    samples = photograph_patches(CAMERA, chart_140()[:60], balances=("daylight",), stops=(-1, 0))
    assert _found(samples) == {}


def test_a_shot_that_departs_is_left_out_named_and_found_again(s40_samples: SampleSet) -> None:
    name = _names(s40_samples)[3]
    changed = with_gamma(s40_samples, [name], 0.8)
    profile = calibrate(changed, CalibrationOptions(size=5))
    assert name not in profile.shots and len(profile.shots) == 4
    (note,) = (note for note in profile.notes if "left out" in note)
    assert name in note and "±" in note and "manual mode" in note
    again = replace(changed, shot=np.char.add(changed.shot, " again"))
    assert [each.shot for each in evaluate(profile, again).departures] == [f"{name} again"]
