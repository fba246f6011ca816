"""Samples that no camera makes are told by their cause; good ones are not accused."""

import time

import numpy as np
import pytest

import lutforge as lf
from lutforge.calibration.plausibility.check import implausible
from lutforge.calibration.plausibility.setting_names import wrong_names
from lutforge.model.diagnosis import told
from lutforge.report.report import build_report
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.benchmarks.plausibility import CASES, applies, brightened, d40, diagnosed, s40, simulated


@pytest.fixture(scope="module")
def sets() -> dict[str, SampleSet]:
    return {"D5100": simulated(nikon_d5100(), seed=0), "D40": d40(0), "S40": s40(0)}


@pytest.mark.parametrize("name", ["D5100", "D40", "S40"])
@pytest.mark.parametrize("case", CASES)
def test_the_cause_is_named(sets: dict[str, SampleSet], case: str, name: str) -> None:
    if not applies(case, name):
        pytest.skip("not to be told from these samples")
    words, spoil = CASES[case]
    found = diagnosed(spoil(sets[name], np.random.default_rng(0)))
    assert any(words in each.cause for each in found), found


def test_good_sets_are_not_accused(sets: dict[str, SampleSet], chart_samples: SampleSet) -> None:
    lights = [
        chart_samples.select((chart_samples.camera == camera) & np.char.startswith(chart_samples.shot, light))
        for camera in np.unique(chart_samples.camera)
        for light in ("light1", "light2")
    ]
    accused = [each for samples in (*sets.values(), *lights) if (each := diagnosed(samples))]
    assert len(accused) <= 1, accused


@pytest.mark.slow
def test_what_few_photographs_hardly_tell_is_told_of_five() -> None:
    for case in ("codes lifted by 8", "each JPEG brightened by up to 0.3 EV", "white balance shifted in the camera"):
        words, spoil = CASES[case]
        told = [diagnosed(spoil(s40(seed), np.random.default_rng(seed))) for seed in range(10)]
        assert sum(any(words in each.cause for each in found) for found in told) >= 9, case


def test_five_thousand_samples_are_judged_in_a_moment() -> None:
    samples = d40(1)
    samples = samples.select(np.resize(np.arange(len(samples)), 5000))
    implausible(samples, samples.wb)
    began = time.process_time()
    implausible(samples, samples.wb)
    assert time.process_time() - began < 1.0  # 0.2 s where nothing else runs


def test_a_profile_keeps_what_was_found_and_blames_no_shot(sets: dict[str, SampleSet]) -> None:
    words, spoil = CASES["RAW white-balanced already"]
    spoilt = spoil(sets["D40"], np.random.default_rng(1))
    profile = lf.calibrate(spoilt, lf.CalibrationOptions(size=5, output_curve=False))
    assert words in profile.diagnoses[0].cause
    assert not any("leave out" in note for note in profile.notes)
    report = build_report(profile)
    assert words in str(report)  # on its first page


def test_diagnoses_survive_the_profile_file(sets: dict[str, SampleSet], tmp_path) -> None:  # type: ignore[no-untyped-def]
    spoilt = CASES["red and blue of the JPEG swapped"][1](sets["D40"], np.random.default_rng(1))
    profile = lf.calibrate(spoilt, lf.CalibrationOptions(size=5, output_curve=False))
    profile.save(tmp_path / "camera.npz")
    assert lf.load_profile(tmp_path / "camera.npz").diagnoses == profile.diagnoses


def test_each_line_says_cause_evidence_and_advice(sets: dict[str, SampleSet]) -> None:
    for case in ("JPEG values linear", "RAW scaled by 1/4"):
        lines = told(diagnosed(CASES[case][1](sets["D40"], np.random.default_rng(1))))
        assert len(lines) == 2
        assert all("\n" not in line and len(line) < 400 for line in lines)
        assert lines[1] == "one good set of samples in a hundred gets such a line by mistake"
    assert told(()) == ()


def test_a_setting_of_another_name_is_told_where_the_other_is_not_in_the_data() -> None:
    given = {"tungsten": (1.3, 2.4), "daylight": (2.1, 1.4), "cloudy": (2.3, 1.3), "shade": (2.5, 1.2)}
    multipliers = {name: np.array([red, 1.0, blue]) for name, (red, blue) in given.items()}
    assert wrong_names(multipliers) is None
    multipliers["tungsten"] = multipliers.pop("daylight")
    found = wrong_names(multipliers)
    assert found is not None and found.cause == 'the white balance "tungsten" has another\'s name'
    assert "daylight" in found.evidence


def test_a_black_and_white_style_is_no_fault(sets: dict[str, SampleSet]) -> None:
    grey = CASES["sepia"][1](sets["D40"], np.random.default_rng(1)).srgb[:, 1]
    samples = SampleSet(
        **{
            name: getattr(sets["D40"], name)
            for name in ("camera", "style", "white_balance", "shot", "patch", "exposure_s", "raw", "wb", "raw_camera")
        },
        srgb=np.repeat(grey[:, None], 3, axis=1),
    )
    assert diagnosed(samples) == ()


def test_a_darker_development_is_told_by_its_sign(sets: dict[str, SampleSet]) -> None:
    samples = sets["D40"]
    dark = brightened(samples, np.full(len(samples), 0.25))
    found = diagnosed(lf.SampleSet(**{**vars(samples), "srgb": dark}))
    assert found and "developed -" in found[0].cause
