"""Shots that were changed in a part of the picture are named; fields of all shots are removed; sound ones are not."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.calibrate import prepared
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.local_changes import LocalChanges, find_local_changes
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.spectra import chart_reflectances
from lutforge.samples.chart import chart_kind
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.samples import (
    lost_stops,
    photograph_patches,
    spread_over_picture,
    surfaces,
    with_dark_corners,
    with_gamma,
)
from tests.cases.spoilt_samples import brightened, livelier

CAMERA = nikon_d5100()


def _photographs(seed: int = 0, count: int = 5) -> SampleSet:
    """Photographs of surfaces of their own, spread over the picture."""
    balances = ("daylight", "shade", "cloudy", "daylight", "tungsten")
    parts = []
    for place in range(count):
        taken = photograph_patches(
            CAMERA, surfaces(120, 50 * seed + place), balances=(balances[place % 5],), stops=(-2 + place / 2,),
            seed=seed + place,
        )  # fmt: skip
        parts.append(replace(taken, shot=np.full(len(taken), f"P{place}")))
    return spread_over_picture(concatenate(parts), seed)


def _charts(stops: tuple[float, ...] = (-3, -2, -1, 0)) -> SampleSet:
    """One chart, in the same place in all shots."""
    samples = photograph_patches(CAMERA, chart_reflectances(), balances=("daylight",), stops=stops)
    places = 0.6 * chart_kind("classic").places * [1.0, 0.7]
    return replace(samples, position=np.tile(places, (len(stops), 1)))


@pytest.fixture(scope="module")
def s40(shared_data: Path) -> SampleSet:
    """Five photographs, with their places in the picture."""
    return lf.sample(sorted((shared_data / "canon_powershot_s40").glob("*.CRW")))


@pytest.fixture(scope="module")
def photographs() -> SampleSet:
    return _photographs()


def _names(samples: SampleSet) -> list[str]:
    return [str(name) for name in np.unique(samples.shot)]


def _prepared(samples: SampleSet) -> CalibrationState:
    return prepared(samples, CalibrationOptions())


def _found(samples: SampleSet) -> LocalChanges:
    state = CalibrationState(samples, samples.wb)
    return find_local_changes(samples, samples.wb, state.unclipped)


def _raw_darkened(samples: SampleSet, shots: list[str], gain: Array) -> SampleSet:
    """The samples with the RAW of some shots multiplied by gains (n,)."""
    within = np.isin(samples.shot, shots)
    return replace(samples, raw=samples.raw * np.where(within, gain, 1.0)[:, None])


def _from_side_to_side(samples: SampleSet, share: float) -> Array:
    """Light (n,) that falls by a share from the left edge of the samples to the right one."""
    x = samples.position[:, 0]
    return np.asarray(1.0 - share * (x - x.min()) / np.ptp(x))


def _graduated(samples: SampleSet) -> Array:
    return np.asarray(np.clip(2.0 * samples.position[:, 1], -1.0, 0.0))


def _dodged(samples: SampleSet) -> Array:
    squared = np.sum((samples.position - [0.25, -0.1]) ** 2, axis=1)
    return np.asarray(0.6 * np.exp(-squared / (2 * 0.2**2)))


def _darkened_corner(samples: SampleSet) -> Array:
    squared = np.sum((samples.position - [-0.6, 0.3]) ** 2, axis=1)
    return np.asarray(-0.7 * np.exp(-squared / (2 * 0.3**2)))


def _local_tones(samples: SampleSet) -> Array:
    """Tone mapping by the brightness of the surroundings, in the shot of each sample."""
    stops = np.zeros(len(samples))
    for name in _names(samples):
        rows = np.flatnonzero(samples.shot == name)
        brightness = np.log2(np.maximum(samples.raw[rows].mean(axis=1), 1e-4))
        for row in rows:
            squared = np.sum((samples.position[rows] - samples.position[row]) ** 2, axis=1)
            around = np.average(brightness, weights=np.exp(-squared / (2 * 0.25**2)))
            stops[row] = -0.6 * (around - brightness.mean())
    return stops


def _half(samples: SampleSet) -> Array:
    return np.where(samples.position[:, 0] > 0.1, 0.4, 0.0)


LOCAL: dict[str, Callable[[SampleSet], Array]] = {
    "graduated filter": _graduated,
    "dodged": _dodged,
    "corner": _darkened_corner,
    "local tones": _local_tones,
    "half": _half,
}
"""By how many stops the JPEG is brighter at the places of samples, (n,)."""


@pytest.mark.parametrize("name", ["simulated", pytest.param("S40", marks=pytest.mark.slow)])
@pytest.mark.parametrize("case", LOCAL)
def test_a_jpeg_changed_in_a_part_is_called_so(
    photographs: SampleSet, case: str, name: str, request: pytest.FixtureRequest
) -> None:
    samples = photographs if name == "simulated" else request.getfixturevalue("s40")
    brighter = np.clip(brightened(samples, 2.0 ** LOCAL[case](samples)), 0.0, 1.0)
    for shot in _names(samples):
        found = _found(replace(samples, srgb=np.where((samples.shot == shot)[:, None], brighter, samples.srgb)))
        assert [change.shot for change in found.changes] == [shot]
        assert found.are_few and found.field is None


def test_a_shot_changed_in_a_part_is_left_out(photographs: SampleSet) -> None:
    brighter = np.clip(brightened(photographs, 2.0 ** _dodged(photographs)), 0.0, 1.0)
    state = _prepared(
        replace(photographs, srgb=np.where((photographs.shot == "P1")[:, None], brighter, photographs.srgb))
    )
    (note,) = state.notes
    assert "left out, P1 (changed in a part of the picture" in note and "manual mode" in note
    assert _names(state.samples) == ["P0", "P2", "P3", "P4"]
    assert state.diagnoses == ()


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_light_that_falls_in_one_raw_is_named_with_side_and_amount(photographs: SampleSet, share: float) -> None:
    for samples in (photographs, _charts()):
        shot = _names(samples)[0]
        state = _prepared(_raw_darkened(samples, [shot], _from_side_to_side(samples, share)))
        (note,) = (note for note in state.notes if "left out" in note)
        assert shot in note and "right than at the " in note
        stated = float(note.partition("EV (")[2].partition("%")[0]) / 100
        assert stated == pytest.approx(share, abs=0.1)


@pytest.mark.parametrize("share", [0.3, 0.6])
@pytest.mark.parametrize("name", ["photographs", "charts", pytest.param("S40", marks=pytest.mark.slow)])
def test_a_field_of_all_shots_is_named_and_removed(
    photographs: SampleSet, share: float, name: str, request: pytest.FixtureRequest
) -> None:
    samples = request.getfixturevalue("s40") if name == "S40" else photographs if name == "photographs" else _charts()
    gain = _from_side_to_side(samples, share)
    state = _prepared(_raw_darkened(samples, _names(samples), gain))
    assert state.diagnoses == ()
    (note,) = (note for note in state.notes if "smooth field" in note)
    assert "from left to right" in note
    stated = float(note.partition("falls by ")[2].partition("%")[0]) / 100
    assert stated == pytest.approx(share, abs=0.08)

    ratio = np.log2(state.samples.raw / samples.raw)
    assert np.std(ratio) < 0.15 * np.std(np.log2(gain)) + 0.02


def test_the_edge_of_a_shadow_in_all_shots_is_named_and_not_smoothed_away(photographs: SampleSet) -> None:
    gain = np.where(photographs.position[:, 0] > 0.2, 0.5, 1.0)
    state = _prepared(_raw_darkened(photographs, _names(photographs), gain))
    (diagnosis,) = state.diagnoses
    assert "differ by place" in diagnosis.cause and "5 of 5 shots" in diagnosis.evidence
    assert not any("smooth field" in note for note in state.notes)
    assert _names(state.samples) == _names(photographs)


def test_of_many_changed_shots_none_is_left_out(photographs: SampleSet) -> None:
    """It is not known then which are right."""
    brighter = np.clip(brightened(photographs, 2.0 ** _dodged(photographs)), 0.0, 1.0)
    within = np.isin(photographs.shot, _names(photographs)[:2])
    state = _prepared(replace(photographs, srgb=np.where(within[:, None], brighter, photographs.srgb)))
    (diagnosis,) = state.diagnoses
    assert "2 of 5 shots (P0, P1)" in diagnosis.evidence
    assert _names(state.samples) == _names(photographs)


@pytest.mark.parametrize("name", ["simulated", pytest.param("S40", marks=pytest.mark.slow)])
def test_a_change_of_the_whole_picture_is_not_called_local(
    photographs: SampleSet, name: str, request: pytest.FixtureRequest
) -> None:
    samples = photographs if name == "simulated" else request.getfixturevalue("s40")
    exposed = np.clip(brightened(samples, np.full(len(samples), 2.0**0.4)), 0.0, 1.0)
    for shot in _names(samples):
        within = (samples.shot == shot)[:, None]
        for changed in (
            with_gamma(samples, [shot], 0.85),
            replace(samples, srgb=np.where(within, exposed, samples.srgb)),
            replace(samples, srgb=np.where(within, livelier(samples.srgb), samples.srgb)),
        ):
            found = _found(changed)
            assert found.changes == () and found.field is None


@pytest.mark.parametrize("count", [1, 3, 5])
@pytest.mark.parametrize("name", ["simulated", pytest.param("S40", marks=pytest.mark.slow)])
def test_pictures_without_hues_are_not_called_local(
    photographs: SampleSet, name: str, count: int, request: pytest.FixtureRequest
) -> None:
    """Their codes do not tell how bright the RAW of a hue was, which follows the place as the scene does."""
    samples = photographs if name == "simulated" else request.getfixturevalue("s40")
    within = np.isin(samples.shot, _names(samples)[:count])[:, None]
    grey = (samples.srgb @ [0.3, 0.59, 0.11])[:, None]
    for tint in ([1.0, 1.0, 1.0], [1.07, 0.95, 0.75]):
        found = _found(replace(samples, srgb=np.where(within, np.clip(grey * tint, 0.0, 1.0), samples.srgb)))
        assert found.changes == () and found.field is None


@pytest.mark.slow
@pytest.mark.parametrize("gamma", [0.85, 1.1])
def test_a_power_of_any_of_five_photographs_names_that_one(s40: SampleSet, gamma: float) -> None:
    for shot in _names(s40):
        state = _prepared(with_gamma(s40, [shot], gamma))
        assert _names(state.samples) == [other for other in _names(s40) if other != shot]


@pytest.mark.parametrize("seed", range(3))
def test_sound_shots_are_left_alone(seed: int) -> None:
    merrill = photograph_patches(sigma_sd_merrill(), surfaces(60, seed), balances=("daylight", "shade"))
    sets = [_photographs(seed), _charts(), _charts((-2, 0)), _charts((0,)), spread_over_picture(merrill, seed)]
    for samples in sets:
        found = _found(samples)
        assert found.changes == () and found.field is None


def test_sound_photographs_are_left_alone(s40: SampleSet) -> None:
    state = _prepared(s40)
    assert len(state.samples) == len(s40) and state.notes == () and state.diagnoses == ()


def test_dark_corners_are_vignetting_and_not_local(photographs: SampleSet) -> None:
    state = _prepared(with_dark_corners(photographs, lost_stops(photographs, 1.0)))
    assert len(state.samples) == len(photographs) and state.diagnoses == ()
    (note,) = state.notes
    assert "vignetting" in note
