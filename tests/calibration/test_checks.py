"""Samples that no camera makes are reported with their cause; good ones are not accused."""

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations, permutations

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.calibrate import prepared
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.dark_greys import dark_end_notes
from lutforge.calibration.deviations import Deviation
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.shot_comparison import ShotCheck, check_shots
from lutforge.calibration.steps import complete_white_balances, diagnose
from lutforge.calibration.style import unclipped
from lutforge.colour.rgb_spaces import to_xyz
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_decode
from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluation import evaluate
from lutforge.pipeline.calibration import calibrate
from lutforge.reports.report import build_report
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.thesis.options import Options, ThesisOptions
from tests.cases.cameras import photographed_at_random
from tests.cases.samples import (
    chart_140,
    photograph_patches,
    shadow_stops,
    spread_over_picture,
    surfaces,
    with_gamma,
    with_scene_tone,
)
from tests.cases.spoilt_samples import CASES, brightened, d40, diagnosed, livelier, s40, simulated


@pytest.fixture(scope="module")
def sets() -> dict[str, SampleSet]:
    return {"D5100": simulated(nikon_d5100(), seed=0), "D40": d40(0), "S40": s40(0)}


@pytest.fixture(scope="module")
def three() -> SampleSet:
    """Three shots: a cause that spoils all samples is found in few of them."""
    return simulated(nikon_d5100(), seed=0, shots=3)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["D5100", "D40", "S40"])
@pytest.mark.parametrize("case", CASES)
def test_the_cause_is_named(sets: dict[str, SampleSet], case: str, name: str) -> None:
    words, spoil = CASES[case]
    found = diagnosed(spoil(sets[name], np.random.default_rng(0)))
    assert any(words in each for each in found), found


@pytest.mark.parametrize("name", ["D5100", pytest.param("S40", marks=pytest.mark.slow)])
@pytest.mark.parametrize("side", ["srgb", "raw"])
@pytest.mark.parametrize(
    "order",
    [
        pytest.param(order, marks=() if order == (2, 1, 0) else pytest.mark.slow)
        for order in permutations(range(3))
        if order != (0, 1, 2)
    ],
)
def test_every_order_of_channels_is_named(
    sets: dict[str, SampleSet], three: SampleSet, order: tuple[int, ...], side: str, name: str
) -> None:
    samples = {"D5100": three, "S40": sets["S40"]}[name]
    spoilt = replace(samples, **{side: getattr(samples, side)[:, order]})
    words = {"srgb": "of the JPEG", "raw": "of the RAW"}[side]
    letters = ", ".join("RGB"[channel] for channel in order)
    (found,) = diagnosed(spoilt)
    assert words in found
    assert ("swapped" if order == (2, 1, 0) else f"are {letters}:") in found


@pytest.mark.slow
@pytest.mark.parametrize("name", ["S40", "D5100", "D40"])
def test_a_cause_is_named_only_where_it_explains_the_samples(sets: dict[str, SampleSet], name: str) -> None:
    (found,) = diagnosed(replace(sets[name], wb=1.0 / sets[name].wb))
    assert "multipliers are inverted" in found


@pytest.mark.parametrize("name", ["D5100", "S40"])
def test_a_channel_that_does_not_go_through_zero_is_named(sets: dict[str, SampleSet], name: str) -> None:
    samples = sets[name]
    for place, channel in enumerate(("red", "green", "blue")):
        off = replace(samples, raw=samples.raw + 0.01 * np.eye(3)[place])
        (note,) = dark_end_notes(off, off.wb)
        assert f"{channel} is off" in note


@pytest.mark.parametrize("name", ["D5100", "D40", "S40"])
def test_black_that_is_off_in_all_channels_is_named(sets: dict[str, SampleSet], name: str) -> None:
    """Codes that were stretched from 16 … 235 have the same dark end as RAW whose black level was left in."""
    samples = sets[name]
    left_in = replace(samples, raw=samples.raw + 0.01)
    stretched = replace(samples, srgb=np.clip((255 * samples.srgb - 16) / 219, 0.0, 1.0))
    for spoilt in (left_in, stretched):
        (note,) = dark_end_notes(spoilt, spoilt.wb)
        assert "RAW stays at" in note and "black level left in the RAW, or JPEGs whose contrast was stretched" in note


@pytest.mark.parametrize("name", ["D5100", pytest.param("D40", marks=pytest.mark.slow)])
@pytest.mark.parametrize("channel", ["red", "green", "blue"])
def test_the_black_level_of_one_channel_is_named(sets: dict[str, SampleSet], channel: str, name: str) -> None:
    place = ("red", "green", "blue").index(channel)
    (found,) = diagnosed(replace(sets[name], raw=sets[name].raw + 0.01 * np.eye(3)[place]))
    assert f"the black level is left in {channel} of the RAW" in found


@pytest.mark.parametrize("name", ["D5100", "D40", "S40"])
def test_ends_of_the_range_that_are_not_reached_are_named(sets: dict[str, SampleSet], name: str) -> None:
    samples = sets[name]
    squeezed = replace(samples, srgb=(16 + 219 * samples.srgb) / 255)
    (note,) = dark_end_notes(squeezed, squeezed.wb)
    assert "or above 235" in note
    veiled = replace(samples, srgb=0.1 + 0.9 * samples.srgb)
    (note,) = dark_end_notes(veiled, veiled.wb)
    assert "no JPEG value lies below" in note and "235" not in note


def test_one_style_of_two_is_not_accused_of_how_files_were_read(three: SampleSet) -> None:
    """A style may have the tones of linear values; a reader that decodes JPEGs decodes those of both styles."""
    samples = three
    contrasty = replace(samples, style=np.full(len(samples), "vivid"), srgb=srgb_decode(samples.srgb))
    assert "JPEG values are linear" in str(diagnosed(contrasty))
    assert diagnosed(concatenate([samples, contrasty])) == ()
    both = concatenate([replace(samples, srgb=srgb_decode(samples.srgb)), contrasty])
    assert "JPEG values are linear" in str(diagnosed(both))


@pytest.mark.parametrize("seed", range(3))
def test_dark_ends_of_sound_samples_are_not_accused(seed: int) -> None:
    sound = [d40(seed), s40(seed)]
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        sound += [simulated(camera, seed), photographed_at_random(camera.name, camera.sensitivity, seed)]
    assert [dark_end_notes(samples, samples.wb) for samples in sound] == [()] * len(sound)


def test_good_sets_are_not_accused(sets: dict[str, SampleSet], chart_samples: SampleSet) -> None:
    lights = [
        chart_samples.select((chart_samples.camera == camera) & np.char.startswith(chart_samples.shot, light))
        for camera in np.unique(chart_samples.camera)
        for light in ("light1", "light2")
    ]
    accused = [each for samples in (*sets.values(), *lights) if (each := diagnosed(samples))]
    assert accused == []


@pytest.mark.slow
def test_a_profile_keeps_what_was_found_and_blames_no_shot(sets: dict[str, SampleSet]) -> None:
    words, spoil = CASES["RAW white-balanced already"]
    spoilt = spoil(sets["D40"], np.random.default_rng(1))
    profile = lf.calibrate(spoilt, lf.CalibrationOptions(size=5))
    assert words in profile.diagnoses[0].cause
    assert not any("shots deviate" in note for note in profile.notes)
    report = build_report(profile)
    assert words in str(report)  # on its first page


@pytest.mark.slow
def test_what_no_cause_explains_is_only_said_to_be_no_camera_s(sets: dict[str, SampleSet]) -> None:
    samples = sets["D40"]
    mixed = replace(samples, srgb=np.random.default_rng(0).permutation(samples.srgb))
    (found,) = diagnose(CalibrationState(mixed, mixed.wb)).diagnoses
    assert found.cause == "these samples do not look like one camera's rendering"
    assert "codes off" in found.evidence


def test_a_black_and_white_style_is_no_fault(sets: dict[str, SampleSet]) -> None:
    grey = CASES["sepia"][1](sets["D40"], np.random.default_rng(1)).srgb[:, 1]
    samples = replace(sets["D40"], srgb=np.repeat(grey[:, None], 3, axis=1))
    assert diagnosed(samples) == ()


CAMERA = nikon_d5100()


def _fifteen(patches: int = 60) -> SampleSet:
    return spread_over_picture(photograph_patches(CAMERA, chart_140()[:patches], stops=(-2, -1, 0)))


def _checked(samples: SampleSet) -> ShotCheck:
    state = complete_white_balances(CalibrationState(samples, samples.wb))
    return check_shots(state.samples, state.multipliers, state.unclipped, state.bases_of_all_colours())


def _found(samples: SampleSet) -> dict[str, Deviation]:
    checked = _checked(samples)
    assert checked.groups == ()
    return {each.shot: each for each in checked.deviations}


def _names(samples: SampleSet) -> list[str]:
    return [str(name) for name in np.unique(samples.shot)]


def test_an_exposure_that_is_off_is_found_with_its_size() -> None:
    samples = _fifteen()
    name = _names(samples)[3]
    (deviation,) = _found(with_scene_tone(samples, [name], np.full(len(samples), 0.3), CAMERA)).values()
    assert deviation.shot == name
    assert deviation.clear == (True, False, False, False, False, False)
    assert deviation.values[0] == pytest.approx(0.3, abs=0.06)


def test_a_power_of_one_shot_is_found() -> None:
    samples = _fifteen()
    for name in _names(samples)[::3]:  # one of each white balance
        assert list(_found(with_gamma(samples, [name], 0.93))) == [name]


def test_a_power_of_any_of_five_photographs_is_found(s40_samples: SampleSet) -> None:
    for name in _names(s40_samples):
        assert list(_found(with_gamma(s40_samples, [name], 0.85))) == [name]


def test_lifted_shadows_of_a_third_of_the_shots_are_contrast() -> None:
    samples = _fifteen()
    third = _names(samples)[::3]
    found = _found(with_scene_tone(samples, third, shadow_stops(samples, 0.5), CAMERA))
    assert sorted(found) == third
    assert all(deviation.clear[1] and deviation.values[1] < 0 for deviation in found.values())


@pytest.mark.parametrize("seed", range(4))
def test_no_shot_of_a_fixed_camera_is_accused(seed: int) -> None:
    for camera in (CAMERA, sigma_sd_merrill()):
        assert _found(photographed_at_random(camera.name, camera.sensitivity, seed)) == {}
    assert _found(_fifteen(24 + 30 * seed)) == {}


# Half of the shots otherwise: nothing says which half is right


def _adobe_rgb(encoded: Array) -> Array:
    from_xyz = np.linalg.inv(to_xyz("adobe-rgb"))
    return np.asarray(np.clip(srgb_decode(encoded) @ (from_xyz @ SRGB_TO_XYZ).T, 0.0, 1.0) ** (1 / 2.2))


def _redder(samples: SampleSet) -> Array:
    return brightened(samples, np.tile([1.12, 1.0, 1.0], (len(samples), 1)))


def _sepia(encoded: Array) -> Array:
    return np.clip((encoded @ [0.3, 0.59, 0.11])[:, None] * [1.07, 0.95, 0.75], 0.0, 1.0)


def _hues_turned(encoded: Array, degrees: float) -> Array:
    """Colours whose chroma is turned about the axis of greys."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    across = np.array([[0.0, -1.0, 1.0], [1.0, 0.0, -1.0], [-1.0, 1.0, 0.0]]) / np.sqrt(3.0)
    turn = cos * np.eye(3) + sin * across + (1.0 - cos) / 3.0
    grey = (encoded @ [0.3, 0.59, 0.11])[:, None]
    return np.asarray(np.clip(grey + (encoded - grey) @ turn.T, 0.0, 1.0))


OTHERWISE: dict[str, tuple[str, Callable[[SampleSet], Array]]] = {
    "lifted shadows": ("contrast", lambda samples: brightened(samples, 2.0 ** shadow_stops(samples, 1.0))),
    "vivid": ("saturation", lambda samples: livelier(samples.srgb)),
    "+ 0.3 EV": ("exposure", lambda samples: brightened(samples, np.full(len(samples), 2.0**0.3))),
    "Adobe RGB": ("primaries", lambda samples: _adobe_rgb(samples.srgb)),
    "a curve": ("contrast", lambda samples: samples.srgb - 0.07 * np.sin(2 * np.pi * samples.srgb)),
    "gamma": ("exposure", lambda samples: samples.srgb**0.85),
    "grey": ("black and white", lambda samples: np.repeat((samples.srgb @ [0.3, 0.59, 0.11])[:, None], 3, axis=1)),
}
"""How shots are rendered otherwise, and what differs then."""
IN_DARK_TONES = {("lifted shadows", "D5100", 2), ("a curve", "D5100", 2), ("lifted shadows", "Merrill", 0)}
"""Changes of contrast that are one of exposure for a group that shows dark tones alone, or nearly so."""


@pytest.fixture(scope="module")
def five(s40_samples: SampleSet) -> dict[str, SampleSet]:
    return {
        "S40": s40_samples,
        "D5100": simulated(CAMERA, 0, shots=5),
        "Merrill": simulated(sigma_sd_merrill(), 2, shots=5),
    }


@pytest.mark.parametrize("name", ["S40", "D5100", pytest.param("Merrill", marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", OTHERWISE)
def test_two_groups_of_shots_are_named_and_none_is_left_out(five: dict[str, SampleSet], case: str, name: str) -> None:
    samples, (words, change) = five[name], OTHERWISE[case]
    names, changed = _names(samples), change(samples)
    for number, others in enumerate((names[:3], names[1:4], names[::2])):
        spoilt = replace(samples, srgb=np.where(np.isin(samples.shot, others)[:, None], changed, samples.srgb))
        checked = _checked(spoilt)
        assert checked.deviations == ()
        (groups,) = checked.groups
        assert sorted((*groups.first, *groups.second, *groups.either)) == names
        divided = [set(groups.first), set(groups.second)]
        assert any(one <= set(others) and not other & set(others) for one, other in (divided, divided[::-1]))
        found = str(groups.diagnosis)
        if (case, name, number) in IN_DARK_TONES:
            assert "exposure" in found and "contrast" not in found
        else:
            assert words in found


def _at_four_settings() -> SampleSet:
    """Five shots of different surfaces at four white balances, two of them in daylight."""
    balances = ("daylight", "shade", "cloudy", "daylight", "tungsten")
    shots = []
    for number, (balance, stop) in enumerate(zip(balances, (-2.0, -1.5, -1.0, -0.5, 0.0), strict=True)):
        shot = photograph_patches(CAMERA, surfaces(120, 500 + number), balances=(balance,), stops=(stop,), seed=number)
        shots.append(replace(shot, shot=np.char.add(f"{number} ", shot.shot)))
    return spread_over_picture(concatenate(shots))


@pytest.mark.parametrize("case", ["+ 0.3 EV", "gamma", "lifted shadows"])
def test_an_exposure_is_not_taken_for_the_gain_of_a_setting_with_one_shot(case: str) -> None:
    samples, change = _at_four_settings(), OTHERWISE[case][1]
    names, changed = _names(samples), change(samples)
    for others in (names[:3], names[1:4], names[::2]):
        spoilt = replace(samples, srgb=np.where(np.isin(samples.shot, others)[:, None], changed, samples.srgb))
        state = prepared(spoilt, CalibrationOptions())
        assert _names(state.samples) == names
        assert ["two groups" in diagnosis.cause for diagnosis in state.diagnoses] == [True]


@pytest.mark.parametrize(
    "name", ["D5100", *(pytest.param(name, marks=pytest.mark.slow) for name in ("S40", "Merrill"))]
)
@pytest.mark.parametrize("case", OTHERWISE)
def test_of_five_shots_only_the_one_that_deviates_is_named(five: dict[str, SampleSet], case: str, name: str) -> None:
    samples, changed = five[name], OTHERWISE[case][1](five[name])
    found = []
    for one in _names(samples):
        checked = _checked(replace(samples, srgb=np.where((samples.shot == one)[:, None], changed, samples.srgb)))
        assert checked.groups == () and [each.shot for each in checked.deviations] in ([], [one])
        found += [each.shot for each in checked.deviations]
    least = 2 if name == "S40" else 5  # these photographs have few colours in common
    assert len(found) >= least


SUBTLE: dict[str, tuple[str, Callable[[SampleSet], Array]]] = {
    "white balance": ("white balance: red", _redder),
    "sepia": ("saturation", lambda samples: _sepia(samples.srgb)),
    "hues": ("primaries", lambda samples: _hues_turned(samples.srgb, 8.0)),
}
"""Changes that leave exposure and contrast as they are, or all but."""


def _well_exposed(count: int) -> SampleSet:
    return photograph_patches(
        CAMERA, chart_140()[:60], balances=("daylight",), stops=np.linspace(-2, 0, count).tolist()
    )


@pytest.mark.parametrize("case", SUBTLE)
def test_half_of_the_shots_of_other_white_balance_tone_or_hues_are_named(case: str) -> None:
    samples, (words, change) = _well_exposed(5), SUBTLE[case]
    names, changed = _names(samples), change(samples)
    for others in (names[:3], names[::2]):
        spoilt = replace(samples, srgb=np.where(np.isin(samples.shot, others)[:, None], changed, samples.srgb))
        checked = _checked(spoilt)
        assert checked.deviations == ()
        (groups,) = checked.groups
        assert others in (sorted(groups.first), sorted(groups.second))
        assert words in str(groups.diagnosis)


@pytest.mark.parametrize("count", [6, 7])
@pytest.mark.parametrize("case", ["white balance", "sepia"])
def test_two_of_six_or_seven_shots_are_named(case: str, count: int) -> None:
    samples = _well_exposed(count)
    names, changed = _names(samples), SUBTLE[case][1](samples)
    spoilt = replace(samples, srgb=np.where(np.isin(samples.shot, names[1:3])[:, None], changed, samples.srgb))
    assert sorted(_found(spoilt)) == names[1:3]


@pytest.mark.parametrize("degrees", [8.0, -8.0])
def test_turned_hues_of_real_photographs_are_named_and_no_sound_shot_is(s40_samples: SampleSet, degrees: float) -> None:
    """Some show too few strong colours to be surely of either side."""
    names, turned = _names(s40_samples), _hues_turned(s40_samples.srgb, degrees)
    found = 0
    for others in (*combinations(names, 1), *combinations(names, 2)):
        within = np.isin(s40_samples.shot, others)[:, None]
        checked = _checked(replace(s40_samples, srgb=np.where(within, turned, s40_samples.srgb)))
        assert {each.shot for each in checked.deviations} <= set(others)
        for groups in checked.groups:
            divided = [set(groups.first), set(groups.second)]
            assert any(one <= set(others) and not other & set(others) for one, other in (divided, divided[::-1]))
            assert any(word in groups.deviation.words for word in ("hue", "primaries"))
        found += bool(checked.deviations or checked.groups)
    assert found >= 10  # of 15


def test_a_power_that_is_too_small_to_be_sure_of_blames_no_other_shot(s40_samples: SampleSet) -> None:
    for name in _names(s40_samples):
        assert list(_found(with_gamma(s40_samples, [name], 1.1))) in ([], [name])


@pytest.mark.slow
def test_colour_among_black_and_white_calibrates_with_both_named(five: dict[str, SampleSet]) -> None:
    samples, grey = five["S40"], OTHERWISE["grey"][1](five["S40"])
    others = np.isin(samples.shot, _names(samples)[:3])
    profile = calibrate(
        replace(samples, srgb=np.where(others[:, None], grey, samples.srgb)), CalibrationOptions(size=5)
    )
    assert "black and white" in str(profile.diagnoses[0])
    assert len(profile.shots) == 5
    assert not any("add shots" in note for note in profile.notes)


def test_two_shots_are_not_accused() -> None:
    samples = photograph_patches(CAMERA, chart_140()[:60], balances=("daylight",), stops=(-1, 0))
    assert _found(samples) == {}


def test_a_shot_that_deviates_is_left_out_named_and_found_again(s40_samples: SampleSet) -> None:
    name = _names(s40_samples)[3]
    changed = with_gamma(s40_samples, [name], 0.8)
    profile = calibrate(changed, CalibrationOptions(size=5))
    assert name not in profile.shots and len(profile.shots) == 4
    (note,) = (note for note in profile.notes if "left out" in note)
    assert name in note and "±" in note and "manual mode" in note
    again = replace(changed, shot=np.char.add(changed.shot, " again"))
    assert [each.shot for each in evaluate(profile, again).deviations] == [f"{name} again"]


OPTIONS: dict[str, Options] = {
    "lutforge": CalibrationOptions(size=5, nonuniform=False),
    "thesis": ThesisOptions(size=5, nonuniform=False),
}


def _shots(*stops: float, balances: tuple[str, ...] = ("daylight",)) -> SampleSet:
    return photograph_patches(CAMERA, chart_140()[:60], balances=balances, stops=stops)


def _refusal(samples: SampleSet, options: Options) -> str:
    with pytest.raises(CalibrationError) as caught:
        calibrate(samples, options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("preset", list(OPTIONS))
@pytest.mark.parametrize("clipped", ["JPEG white", "JPEG black", "RAW"])
def test_all_clipped(preset: str, clipped: str) -> None:
    samples, ends = _shots(0), np.full((60, 3), float(clipped != "JPEG black"))
    samples = replace(samples, raw=ends) if clipped == "RAW" else replace(samples, srgb=ends)
    message = _refusal(samples, OPTIONS[preset])
    assert "0 unclipped samples" in message and "add shots" in message


def test_one_colour_many_times_is_one_sample() -> None:
    samples = _shots(0)
    assert "1 unclipped samples of different" in _refusal(samples.select(np.full(200, 20)), OPTIONS["lutforge"])


def _notes(samples: SampleSet, preset: str) -> str:
    return "; ".join(calibrate(samples, OPTIONS[preset]).notes)


@pytest.mark.parametrize("preset", list(OPTIONS))
def test_a_style_of_too_few_samples_is_left_out_of_the_others_profile(preset: str) -> None:
    samples = _shots(-1, 0, 1)
    other = samples.select(np.flatnonzero(unclipped(samples, samples.wb))[:9])
    both = concatenate([samples, replace(other, style=np.full(9, "vivid"), shot=np.full(9, "V.dng"))])
    profile, alone = calibrate(both, OPTIONS[preset]), calibrate(samples, OPTIONS[preset])
    assert list(profile.styles) == ["standard"]
    np.testing.assert_array_equal(profile.matrix, alone.matrix)
    assert any('style "vivid": 9 unclipped samples' in note and "left out" in note for note in profile.notes)
    found = evaluate(profile, both)
    assert any("vivid" in note and "not in the profile" in note for note in found.notes)


def test_no_unsaturated_colours() -> None:
    samples = _shots(-1, 0)
    strong = samples.select(samples.srgb.min(axis=1) < 0.4 * samples.srgb.max(axis=1))
    notes = _notes(strong, "lutforge")  # a lattice of these colours can be had, but not silently
    assert "unsaturated" in notes and "grey card" in notes


def test_shots_without_bright_colours_are_named() -> None:
    assert "brighter tones are guessed" in _notes(_shots(-4, -3), "lutforge")
    assert "brighter" not in _notes(_shots(-1, 0, 1), "lutforge")


@pytest.mark.parametrize("preset", list(OPTIONS))
def test_one_exposure_only(preset: str) -> None:
    samples = _shots(0)
    notes = _notes(samples, preset)  # RAW determines the response, so it can be done, but says so
    assert ("several shutter speeds" in notes) == (preset == "thesis")
    assert "one exposure only: shoot the same at" in notes and "one shot only" in notes


@pytest.mark.parametrize("preset", ["lutforge", pytest.param("thesis", marks=pytest.mark.slow)])
def test_two_contradicting_shots(preset: str) -> None:
    samples = _shots(-1, 0)
    bright = samples.shot == "standard daylight -1"
    lifted = np.where(bright[:, None], samples.srgb**0.6, samples.srgb)  # as if D-Lighting were on
    profile = calibrate(replace(samples, srgb=lifted), OPTIONS[preset])
    words = {"lutforge": "two groups", "thesis": "do not look like one camera's rendering"}[preset]
    assert words in str(profile.diagnoses[0])


@pytest.mark.slow
def test_one_shot_that_contradicts_many_is_named() -> None:
    samples = _shots(-2, -1, 0, 0.5, 1)
    stray = samples.shot == "standard daylight -1"
    lifted = np.where(stray[:, None], samples.srgb**0.6, samples.srgb)
    profile = calibrate(replace(samples, srgb=lifted), OPTIONS["lutforge"])
    assert any("standard daylight -1" in note and "left out" in note for note in profile.notes)
    assert not any("daylight +0" in note for note in profile.notes)


@pytest.mark.parametrize("preset", list(OPTIONS))
def test_a_white_balance_with_one_shot_is_named(preset: str) -> None:
    samples = concatenate([_shots(-1, 0), _shots(0, balances=("shade",))])
    notes = _notes(samples, preset)
    assert '"shade": one shot only (standard shade +0)' in notes and "add a second" in notes


def test_an_empty_set_and_two_cameras_are_refused() -> None:
    samples = _shots(0)
    assert "0 samples" in _refusal(samples.select(np.zeros(60, dtype=np.bool_)), OPTIONS["lutforge"])
    other = photograph_patches(sigma_sd_merrill(), chart_140()[:60], balances=("daylight",), stops=(0,))
    words = _refusal(concatenate([samples, other]), OPTIONS["lutforge"])
    assert "one camera at a time" in words
    for camera in (samples, other):  # so that one can take them apart
        assert f"{camera.camera[0]}: {', '.join(np.unique(camera.shot)[:3])}" in words


def test_a_grey_card_alone_cannot_tell_the_matrix() -> None:
    samples = photograph_patches(CAMERA, np.tile(chart_140()[20:24], (5, 1)), balances=("daylight",))
    assert "all colours are grey" in _notes(samples, "lutforge")


def test_samples_that_suffice_make_no_such_notes() -> None:
    notes = _notes(_shots(-1, 0), "lutforge")
    assert "unsaturated" not in notes and "grey" not in notes and "one exposure" not in notes


@pytest.mark.slow
def test_shots_of_one_scene_say_that_the_error_on_others_is_not_known(s40_samples: SampleSet) -> None:
    few = s40_samples.select(np.arange(0, len(s40_samples), 4))  # of each shot a hundred and more
    one, rng = few.select(few.shot == _names(few)[0]), np.random.default_rng(0)
    burst = []
    for place in range(3):
        noisy = one.raw * (1.0 + 0.01 * rng.standard_normal(one.raw.shape))
        burst.append(replace(one, raw=noisy, shot=np.full(len(one), f"burst {place}")))
    for shots in (burst, [replace(one, shot=shot.shot) for shot in burst]):
        profile = calibrate(concatenate(shots), CalibrationOptions(size=5))
        assert any("of one scene" in note and "not known" in note for note in profile.notes)
        assert profile.styles["standard"].errors == {}
    mixed = calibrate(
        concatenate([*burst, *(few.select(few.shot == name) for name in _names(few)[1:])]), CalibrationOptions(size=5)
    )
    alone = calibrate(few, CalibrationOptions(size=5))
    for figure, error in alone.styles["standard"].errors.items():
        if figure.endswith("_mean"):
            assert mixed.styles["standard"].errors[figure] > error / 1.5
