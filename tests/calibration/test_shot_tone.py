"""What a camera does to the tone of single shots: found where it is there, of the right size, and never invented."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.shots.tone import shot_tones
from lutforge.calibration.shots.tone_correction import without_departures
from lutforge.calibration.style_data import unclipped
from lutforge.errors import ProfileError
from lutforge.evaluation.evaluate import evaluate
from lutforge.model.camera_profile import load_profile
from lutforge.model.shot_tone import ShotTone, tone_stops
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.benchmarks.unseen_cameras import photographed, unseen_camera
from tests.calibration.samples_of_today import (
    local_stops,
    shadow_stops,
    spread_over_picture,
    with_gamma,
    with_scene_tone,
)
from tests.calibration.samples_simulated import chart_140, photograph_patches
from tests.real_data import PublishedPairs

CAMERA = nikon_d5100()


def _fifteen(patches: int = 60) -> SampleSet:
    return spread_over_picture(photograph_patches(CAMERA, chart_140()[:patches], stops=(-2, -1, 0)))


def _tones(samples: SampleSet) -> dict[str, ShotTone]:
    multipliers, _ = complete_multipliers(samples)
    return {tone.shot: tone for tone in shot_tones(samples, multipliers, unclipped(samples, multipliers))}


def _names(samples: SampleSet) -> list[str]:
    return [str(name) for name in np.unique(samples.shot)]


def test_a_power_of_one_shot_is_found_with_its_size() -> None:
    samples = _fifteen()
    name = "standard daylight -1"
    changed = with_gamma(samples, [name], 0.93)
    found = _tones(changed)
    assert list(found) == [name]
    assert "tone: shadows" in found[name].words
    mine = samples.shot == name
    light = [CAMERA.linearize(each.srgb[mine], "standard", "daylight").sum(axis=1) for each in (samples, changed)]
    true = np.log2(light[1] / light[0])
    stops = tone_stops(changed, found.values())
    np.testing.assert_allclose(stops[mine], true, atol=0.2 * true.max())
    assert not stops[~mine].any()


def test_lifted_shadows_of_a_third_of_the_shots_are_found() -> None:
    samples = _fifteen()
    third = _names(samples)[::3]
    true = shadow_stops(samples, 0.5)
    found = _tones(with_scene_tone(samples, third, true, CAMERA))
    assert sorted(found) == third
    for name, tone in found.items():
        dark = np.sort(true[samples.shot == name])[-6:].mean()
        assert tone.shadows == pytest.approx(dark, rel=0.2)
        assert abs(tone.highlights) < 0.2 * dark and tone.local == 0.0


def test_a_departure_is_taken_out_where_it_arose() -> None:
    """A power of codes comes out of the codes, channel by channel; lifted shadows come out of the light."""
    samples = _fifteen()
    names = [_names(samples)[4]]
    mine = np.isin(samples.shot, names)
    usable = unclipped(samples, samples.wb)
    for changed, of_codes in (
        (with_gamma(samples, names, 0.93), True),
        (with_scene_tone(samples, names, shadow_stops(samples, 0.5), CAMERA), False),
    ):
        even, multipliers = without_departures(changed, samples.wb, usable, list(_tones(changed).values()))
        np.testing.assert_array_equal(multipliers, samples.wb)
        assert np.array_equal(even.raw, samples.raw) is of_codes
        assert np.array_equal(even.srgb, changed.srgb) is not of_codes
        np.testing.assert_array_equal(even.srgb[~mine], samples.srgb[~mine])
        if of_codes:
            before, after = (np.abs(each.srgb - samples.srgb)[mine & usable].mean() for each in (changed, even))
            assert after < 0.2 * before


@pytest.mark.parametrize("first", [0, 1, 2])
def test_lifted_shadows_come_out_whatever_mixture_of_channels_the_camera_takes_for_tone(first: int) -> None:
    """Here the camera takes the mean of the channels before white balance: 0.016, 0.010, 0.008 EV by one after it."""
    samples = _fifteen()
    third = _names(samples)[first::3]
    true = shadow_stops(samples, 0.5)
    changed, usable = with_scene_tone(samples, third, true, CAMERA), unclipped(samples, samples.wb)
    even, _ = without_departures(changed, samples.wb, usable, list(_tones(changed).values()))
    mine = np.isin(samples.shot, third) & usable
    off = np.log2(even.raw / samples.raw).mean(axis=1) - true
    assert np.sqrt(np.mean(off[mine] ** 2)) < (0.012, 0.007, 0.006)[first]


def test_exposures_that_are_off_are_called_so() -> None:
    samples = _fifteen()
    name = _names(samples)[3]
    (tone,) = _tones(with_scene_tone(samples, [name], np.full(len(samples), 0.3), CAMERA)).values()
    assert (tone.shot, tone.words) == (name, f"exposure {tone.exposure:+.2f} EV")
    assert tone.exposure == pytest.approx(0.3, abs=0.06)


@pytest.mark.slow
def test_local_tone_is_found_and_left_out() -> None:
    samples = _fifteen(100)
    third = _names(samples)[::3]
    true = local_stops(samples, 0.4)
    changed = with_scene_tone(samples, third, true, CAMERA)
    found = _tones(changed)
    assert sorted(found) == third
    for name, tone in found.items():
        assert tone.local == pytest.approx(float(np.std(true[samples.shot == name])), rel=0.25)
    profile = calibrate(changed, CalibrationOptions(size=7))
    assert not set(third) & set(profile.shots)
    (note,) = (note for note in profile.notes if "local: " in note)
    assert f"{third[0]} (" in note and "left out" in note and note.count("EV from place to place") == 4


@pytest.mark.parametrize("seed", range(4))
def test_no_shot_of_a_fixed_camera_is_accused(seed: int) -> None:
    assert _tones(photographed(unseen_camera(seed), known=True, seed=seed)) == {}
    assert _tones(_fifteen(24 + 30 * seed)) == {}


def test_real_cameras_are_fixed(s40_samples: SampleSet, chart_samples: SampleSet, d40_pairs: PublishedPairs) -> None:
    assert _tones(s40_samples) == {}
    for camera in np.unique(chart_samples.camera):
        assert _tones(chart_samples.select(chart_samples.camera == camera)) == {}, camera
    count = len(d40_pairs.balanced)
    first = _fifteen(24).select(np.zeros(count, dtype=np.intp))
    shots = np.char.add("shot", (np.arange(count) % 10).astype(np.str_))
    pairs = replace(first, raw=d40_pairs.balanced, srgb=d40_pairs.encoded, shot=shots, wb=np.ones((count, 3)))
    assert _tones(pairs) == {}


@pytest.mark.parametrize("place", range(5))
def test_a_power_of_one_of_few_real_shots_is_found(s40_samples: SampleSet, place: int) -> None:
    name = _names(s40_samples)[place]
    assert list(_tones(with_gamma(s40_samples, [name], 0.85))) == [name]


def test_a_profile_keeps_what_it_took_out_and_evaluation_splits_the_error(tmp_path: Path) -> None:
    samples = _fifteen()
    third = _names(samples)[::3]
    lifted = with_scene_tone(samples, third, shadow_stops(samples, 0.5), CAMERA)
    calibrate(lifted, CalibrationOptions(size=9)).save(tmp_path / "camera.npz")
    profile = load_profile(tmp_path / "camera.npz")
    assert sorted(tone.shot for tone in profile.tones) == third
    other = replace(lifted, shot=np.char.add(lifted.shot, " again"))
    for table, names in ((lifted, third), (other, [f"{name} again" for name in third])):
        found = evaluate(profile, table)
        (shares,) = found.shares
        assert sorted(tone.shot for tone in found.tones if tone.shot in table.shot) == names
        parts = np.array([shares.rendering, shares.falloff, shares.scene, shares.noise])
        assert shares.total == pytest.approx(float(np.linalg.norm(parts)), rel=1e-6)
        assert shares.scene > 0.9 * shares.total and shares.falloff == 0.0
        table_row = next(row for row in found.rows if (row.method, row.direction) == (shares.method, "render"))
        left = float(np.hypot(shares.rendering, shares.noise)) if table is lifted else shares.total
        assert left == pytest.approx(table_row.figures.rmse, rel=0.02)  # RMSE has one meaning


def test_numbers_that_no_camera_makes_are_refused() -> None:
    with pytest.raises(ProfileError, match="no camera makes"):
        ShotTone("one", "standard", (np.inf, 0.0, 0.0), 0.0, 0.0, 0.0)


def test_two_shots_that_agree_are_not_accused() -> None:
    samples = photograph_patches(CAMERA, chart_140()[:60], balances=("daylight",), stops=(-1, 0))
    assert _tones(samples) == {}
