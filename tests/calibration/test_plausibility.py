"""Samples that no camera makes are told by their cause; good ones are not accused."""

from dataclasses import replace

import numpy as np
import pytest

import lutforge as lf
from lutforge.calibration.plausibility import implausible
from lutforge.report.report import build_report
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.cases.spoilt_samples import CASES, applies, d40, diagnosed, s40, simulated

HARDLY_TOLD = {
    ("one in ten shots of another style", "S40"),
    ("a third of the shots of another sensor", "S40"),
    ("black level 700 for 600", "S40"),
    ("one JPEG brightened by 0.5 EV", "S40"),
}
"""Five photographs have too few colours in common, and hardly any dark ones."""


@pytest.fixture(scope="module")
def sets() -> dict[str, SampleSet]:
    return {"D5100": simulated(nikon_d5100(), seed=0), "D40": d40(0), "S40": s40(0)}


@pytest.mark.parametrize("name", ["D5100", "D40", "S40"])
@pytest.mark.parametrize("case", CASES)
def test_the_cause_is_named(sets: dict[str, SampleSet], case: str, name: str) -> None:
    if not applies(case, name) or (case, name) in HARDLY_TOLD:
        pytest.skip("these samples do not have what the case changes, or not enough of it")
    words, spoil = CASES[case]
    found = diagnosed(spoil(sets[name], np.random.default_rng(0)))
    assert any(words in each for each in found), found


def test_good_sets_are_not_accused(sets: dict[str, SampleSet], chart_samples: SampleSet) -> None:
    lights = [
        chart_samples.select((chart_samples.camera == camera) & np.char.startswith(chart_samples.shot, light))
        for camera in np.unique(chart_samples.camera)
        for light in ("light1", "light2")
    ]
    accused = [each for samples in (*sets.values(), *lights) if (each := diagnosed(samples))]
    assert accused == []


def test_a_profile_keeps_what_was_found_and_blames_no_shot(sets: dict[str, SampleSet]) -> None:
    words, spoil = CASES["RAW white-balanced already"]
    spoilt = spoil(sets["D40"], np.random.default_rng(1))
    profile = lf.calibrate(spoilt, lf.CalibrationOptions(size=5))
    assert words in profile.diagnoses[0].cause
    assert not any("shots depart" in note for note in profile.notes)
    report = build_report(profile)
    assert words in str(report)  # on its first page


def test_settings_with_each_other_s_names_are_told_by_the_warmth_of_their_light(sets: dict[str, SampleSet]) -> None:
    other = {"tungsten": "shade", "shade": "tungsten"}
    names = np.array([other.get(str(name), str(name)) for name in sets["D5100"].white_balance])
    (found,) = diagnosed(replace(sets["D5100"], white_balance=names))
    assert found == 'the white balances "tungsten" and "shade" have each other\'s names'


def test_what_no_cause_explains_is_only_said_to_be_no_camera_s(sets: dict[str, SampleSet]) -> None:
    samples = sets["D40"]
    mixed = replace(samples, srgb=np.random.default_rng(0).permutation(samples.srgb))
    (found,) = implausible(mixed, mixed.wb)
    assert found.cause == "these samples do not look like one camera's rendering"
    assert "codes off" in found.evidence


def test_a_black_and_white_style_is_no_fault(sets: dict[str, SampleSet]) -> None:
    grey = CASES["sepia"][1](sets["D40"], np.random.default_rng(1)).srgb[:, 1]
    samples = replace(sets["D40"], srgb=np.repeat(grey[:, None], 3, axis=1))
    assert diagnosed(samples) == ()
