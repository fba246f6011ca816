"""The vignetting that a camera corrects in its JPEGs only: found where it is there, and never invented."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lutforge.calibration.calibrate import calibrate as calibrate_once
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import unclipped
from lutforge.calibration.vignetting import at_the_centre, fit_vignettings
from lutforge.errors import ProfileError
from lutforge.evaluation.evaluation import evaluate
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile import PictureStyle
from lutforge.model.vignetting import NO_SHADING, Vignetting, vignetting_of
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.sampling import sample
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import (
    lost_stops,
    photograph_patches,
    spread_over_picture,
    surfaces,
    with_bright_jpegs,
    with_dark_corners,
)

BALANCES = ("tungsten", "daylight", "shade")


def _photographed(count: int = 80, seed: int = 0, stops: tuple[int, ...] = (-2, -1, 0)) -> SampleSet:
    samples = photograph_patches(nikon_d5100(), surfaces(count, seed), balances=BALANCES, stops=stops, seed=seed)
    return spread_over_picture(samples, seed)


def _fitted(samples: SampleSet) -> tuple[Vignetting, ...]:
    return fit_vignettings(samples, samples.wb, unclipped(samples, samples.wb))


@pytest.mark.parametrize("power", [1.0, 1.5])
@pytest.mark.parametrize(("ev", "centre"), [(0.3, (0.0, 0.0)), (1.0, (0.05, -0.06)), (2.0, (0.0, 0.0))])
def test_vignetting_is_recovered(ev: float, centre: tuple[float, float], power: float) -> None:
    """A power of the distance from the centre, and the fourth power of a cosine."""
    samples = _photographed()
    fourth = 2.0 * np.log2(1.0 + 0.7 * np.sum(samples.position**2, axis=1))
    for stops, within in ((lost_stops(samples, ev, centre, power), 0.05), (fourth, 0.02)):
        (vignetting,) = _fitted(with_dark_corners(samples, stops))
        np.testing.assert_allclose(vignetting.stops(samples.position), stops[:, None].repeat(3, axis=1), atol=within)


@pytest.mark.slow
def test_vignetting_of_real_photographs_is_recovered(shared_data: Path) -> None:
    """RAW darkened, or JPEGs brightened through the camera's own rendering. As they are, none is found."""
    photographs = sample([shared_data / "canon_powershot_s40"])
    assert _fitted(photographs) == ()
    profile, _ = calibrate_once(photographs, CalibrationOptions(size=17))
    for ev, centre in ((0.3, (0.0, 0.0)), (1.5, (0.0, 0.0)), (0.85, (0.06, -0.05))):
        stops = lost_stops(photographs, ev, centre)
        for samples in (with_dark_corners(photographs, stops), with_bright_jpegs(photographs, stops, profile)):
            (vignetting,) = _fitted(samples)
            np.testing.assert_allclose(vignetting.stops(photographs.position)[:, 1], stops, atol=0.03)
            assert vignetting.shading == NO_SHADING


def test_lens_settings_have_vignettings_of_their_own() -> None:
    samples = _photographed(60)
    one = np.char.endswith(samples.shot, "-1")
    stops = np.where(one, lost_stops(samples, 0.8), 0.0)
    aperture, focal_mm = np.where(one, 2.8, 8.0), np.full(len(samples), 35.0)
    spoilt = replace(with_dark_corners(samples, stops), aperture=aperture, focal_mm=focal_mm)
    (vignetting,) = _fitted(spoilt)
    assert (vignetting.focal_mm, vignetting.aperture) == (35.0, 2.8)
    assert vignetting.setting == "35 mm f/2.8"
    centred = at_the_centre(spoilt, (vignetting,)).raw
    assert np.array_equal(centred[~one], spoilt.raw[~one])  # f/8 loses nothing
    np.testing.assert_allclose(np.log2(centred / samples.raw), 0.0, atol=0.05)


def test_settings_of_no_sample_take_the_nearest_of_their_lens() -> None:
    vignetting = Vignetting((0.1, 0.2, 0.3), lens="Nikkor", focal_mm=35.0, aperture=4.0)
    near, unknown = replace(vignetting, aperture=4.5), replace(vignetting, focal_mm=np.nan)
    for known, setting, nearest in (
        ((near, vignetting), ("Nikkor", 35.0, 4.0), vignetting),
        ((near,), ("Nikkor", 35.0, 4.0), near),  # a third of a stop off
        ((vignetting,), ("Nikkor", 35.0, 6.3), None),
        ((vignetting,), ("Zeiss", 35.0, 4.0), None),
        ((vignetting,), ("Nikkor", np.nan, 4.0), None),
        ((vignetting, unknown), ("Nikkor", np.nan, 4.0), unknown),
    ):
        assert vignetting_of(known, *setting) is nearest


@pytest.mark.parametrize("seed", range(6))
def test_no_vignetting_is_invented(seed: int) -> None:
    samples = _photographed(30, seed)
    fixed = replace(samples, position=samples.position[samples.patch.astype(int)])  # one chart, never moved
    assert _fitted(samples) == _fitted(fixed) == ()


SHADINGS = {
    "drone": (0.3, 0.15, 0.05),
    "slanting light": (0.1, 0.0, 0.0),
    "cool corners": (0.0, 0.1, 0.2),
}
"""Shares of red, green and blue that are lost in the corners."""


def _shaded(samples: SampleSet, losses: tuple[float, float, float]) -> SampleSet:
    q = np.sum(samples.position**2, axis=1, keepdims=True)
    return replace(samples, raw=samples.raw * (1.0 - q * np.array(losses)))


@pytest.mark.parametrize("shading", SHADINGS)
def test_each_channel_has_its_own_vignetting(shading: str, tmp_path: Path) -> None:
    samples = _photographed()
    (vignetting,) = _fitted(_shaded(samples, SHADINGS[shading]))
    corners = np.array([[0.6, 0.6], [-0.5, 0.5], [0.0, 0.0]])
    lost = -np.log2(1.0 - np.sum(corners**2, axis=1, keepdims=True) * np.array(SHADINGS[shading]))
    np.testing.assert_allclose(vignetting.stops(corners), lost, atol=0.03)

    profile = CameraProfile("Test", np.eye(3), {"auto": WhiteBalance((2.0, 1.0, 1.5))}, {"standard": PictureStyle()})
    replace(profile, vignettings=(vignetting,)).save(tmp_path / "camera.npz")
    assert load_profile(tmp_path / "camera.npz").vignettings[0].shading == vignetting.shading
    assert "red" in vignetting.note


@pytest.mark.slow
def test_photographs_with_shaded_channels_are_predicted_as_sound_ones(shared_data: Path) -> None:
    photographs = sample([shared_data / "canon_powershot_s40"])
    errors = []
    for samples in (photographs, _shaded(photographs, SHADINGS["drone"])):
        profile = calibrate(samples, CalibrationOptions(size=9))
        errors.append(profile.styles["standard"].errors["render_mean"])
    assert errors[1] < 1.15 * errors[0]


def test_samples_without_places_tell_nothing() -> None:
    samples = _photographed(30)
    dark = with_dark_corners(samples, lost_stops(samples, 1.0))
    assert _fitted(replace(dark, position=np.full_like(dark.position, np.nan))) == ()


def test_what_changes_from_side_to_side_is_no_vignetting() -> None:
    samples = _photographed(80)
    assert _fitted(with_dark_corners(samples, 0.5 * samples.position[:, 0])) == ()


@pytest.mark.slow
def test_unseen_shots_are_predicted_as_without(tmp_path: Path) -> None:
    options = CalibrationOptions(size=9)
    errors, noted = [], []
    for ev in (0.0, 1.0):
        seen, unseen = _photographed(60, 1), _photographed(60, 2, stops=(-1, 0))
        unseen = replace(unseen, shot=np.char.add(unseen.shot, " unseen"))
        profile = calibrate(with_dark_corners(seen, lost_stops(seen, ev)), options)
        profile.save(tmp_path / "camera.npz")
        profile = load_profile(tmp_path / "camera.npz")
        table = evaluate(profile, with_dark_corners(unseen, lost_stops(unseen, ev))).rows
        errors.append(next(row.figures.mean for row in table if (row.shot, row.method) == ("all", "lattice")))
        noted.append(any("vignetting" in note for note in profile.notes))
    assert errors[1] < 1.1 * errors[0]
    assert noted == [False, True]


@pytest.mark.parametrize(
    "wrong",
    [
        {"coefficients": (np.nan, 0.0, 0.0)},
        {"centre": (3.0, 0.0)},
        {"aperture": 0.0},
        {"shading": ((30.0,) * 3,) * 3},
        {"shading": ()},
    ],
)
def test_numbers_that_no_lens_has_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ProfileError, match="no lens has"):
        replace(Vignetting((0.1, 0.2, 0.3), lens="Nikkor", focal_mm=35.0, aperture=4.0), **wrong)
