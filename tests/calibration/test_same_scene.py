"""Shots of one scene at about one exposure are one, whatever they are called; those of other scenes are not."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.same_scene import is_one_scene
from lutforge.calibration.style import StyleData
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import photograph_patches, spread_over_picture, surfaces

CAMERA = nikon_d5100()


def _photograph(seed: int, stop: float = -1.0, balance: str = "daylight") -> SampleSet:
    """A photograph of a scene of its own, whose samples have places."""
    taken = photograph_patches(
        CAMERA, surfaces(160, seed), balances=(balance,), stops=(stop,), exposure_error=0.0, seed=seed
    )
    return spread_over_picture(taken, seed)


def _frames(seed: int, stops: list[float], motion: float = 0.0) -> list[SampleSet]:
    """Photographs of one scene, of each of which other areas were sampled."""
    rng, frames = np.random.default_rng(seed), []
    for number, stop in enumerate(stops):
        some = np.sort(rng.permutation(160)[:100])
        frame = _photograph(seed, stop).select(some)
        moved = frame.position + number * motion + rng.normal(0.0, 0.002, frame.position.shape)
        names = np.char.add(frame.patch, f" {number}")
        frames.append(replace(frame, position=moved, patch=names, shot=np.full(100, f"{seed} {number}")))
    return frames


@pytest.mark.parametrize(
    ("stops", "motion"),
    [([-1.0, -1.0], 0.0), ([-1.0, -1.0], 0.005), ([-1.0, -2 / 3], 0.0), ([-1.0, -4 / 3], 0.005)],
    ids=["copy", "burst in the hand", "a third of a stop more", "a third less, in the hand"],
)
def test_frames_of_one_scene_are_one(stops: list[float], motion: float) -> None:
    assert is_one_scene(*_frames(0, stops, motion))


def test_shots_of_a_table_without_places_are_matched_by_their_patches() -> None:
    one = replace(_photograph(0), position=np.full((160, 2), np.nan))
    other = replace(_photograph(1), position=np.full((160, 2), np.nan))
    brighter = replace(_photograph(0, -0.7), position=np.full((160, 2), np.nan))
    assert is_one_scene(one, brighter)
    assert not is_one_scene(one, other)  # of the same names of patches


def test_other_scenes_exposures_and_balances_are_not_one() -> None:
    one = _photograph(0)
    assert not is_one_scene(one, _photograph(1))
    assert not is_one_scene(one, _photograph(0, 0.0))  # other tones, which test the response
    assert not is_one_scene(one, _photograph(0, balance="shade"))


def test_copies_and_a_burst_are_one_scene_beside_others() -> None:
    samples = concatenate([*_frames(0, [-1.0, -2 / 3, -1 / 3]), *_frames(1, [-1.0]), *_frames(2, [-1.0, -1.0], 0.004)])
    data = StyleData(samples.raw * samples.wb, samples.srgb, samples.shot, samples)
    scenes = {frozenset(samples.shot[data.scene == scene].tolist()) for scene in np.unique(data.scene)}
    assert scenes == {frozenset({"0 0", "0 1", "0 2"}), frozenset({"1 0"}), frozenset({"2 0", "2 1"})}


@pytest.mark.slow
def test_the_error_is_not_stated_of_one_scene_and_qualified_of_two() -> None:
    options = CalibrationOptions(size=5)
    alone = calibrate(concatenate(_frames(0, [-4 / 3, -1.0, -2 / 3, -1 / 3])), options)
    assert any("of one scene" in note and "not known" in note for note in alone.notes)
    assert alone.styles["standard"].errors == {}

    twice = calibrate(concatenate([*_frames(0, [-1.0, -1.0]), *_frames(1, [-1.0, -2 / 3])]), options)
    assert any("4 shots are of two scenes" in note for note in twice.notes)
    assert twice.styles["standard"].errors["render_mean"] > 0.0
