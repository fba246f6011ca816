"""Vignetting from RAW files of a lens whose light falls off towards the corners, corrected in the JPEGs only."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.arrays import Single
from lutforge.calibration.options import CalibrationOptions
from lutforge.images.read import read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.vignetting import Vignetting
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.grading import apply
from lutforge.samples.extract import extract
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.develop import BORDER
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import Photograph, photograph
from lutforge.simulate.scenes import chart_scene
from tests.cases.samples import (
    chart_140,
    photograph_patches,
)

CAMERA = nikon_d5100()
LENS = Vignetting((0.5, 0.5, 0.4), (0.03, -0.04), aperture=8.0)


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> Photograph:
    settings = CameraSettings(exposure_s=0.8 * CAMERA.nominal_exposure_s, vignetting=LENS, preview_scale=1.0)
    return photograph(CAMERA, chart_scene(400, 600), settings, tmp_path_factory.mktemp("shot"), "dark-corners")


@pytest.fixture(scope="module")
def profile() -> CameraProfile:
    samples = photograph_patches(CAMERA, chart_140(), balances=("daylight",), stops=(-4, -2, 0))
    return calibrate(samples, CalibrationOptions(size=9))


def _error(profile: CameraProfile, shot: Photograph, folder: Path) -> Single:
    """Of the RAW graded by a profile against the camera's JPEG, smoothed over 8 × 8 pixels."""
    profile.save(folder / "camera.npz")
    result = apply(folder / "camera.npz", shot.dng, folder / "graded", suffix=".png")
    assert not result.failed
    graded = read_image(next((folder / "graded").iterdir())).pixels[BORDER // 2 : -BORDER // 2, BORDER:-BORDER]
    assert shot.jpeg is not None
    difference = graded - read_image(shot.jpeg).pixels
    height, width = (size // 8 for size in difference.shape[:2])
    cells = difference[: 8 * height, : 8 * width].reshape(height, 8, width, 8, 3).mean(axis=(1, 3))
    return np.asarray(np.abs(cells).max(axis=-1))


def test_apply_brightens_the_corners(profile: CameraProfile, shot: Photograph, tmp_path: Path) -> None:
    known = _error(replace(profile, vignettings=(LENS,)), shot, tmp_path)
    other = _error(replace(profile, vignettings=(replace(LENS, lens="another"),)), shot, tmp_path)
    corner, middle = np.s_[:6, :6], np.s_[20:28, 32:40]
    assert np.median(known[corner]) < 0.01
    assert np.median(other[corner]) > 0.1
    assert np.median(known[middle]) < 0.01


def test_samples_of_a_photograph_know_their_places(profile: CameraProfile, shot: Photograph) -> None:
    """RAW, brightened at its places, is what the camera rendered."""
    samples = extract(read_shot(shot.dng)).samples
    gain = 2.0 ** LENS.stops(samples.position)
    assert np.ptp(np.linalg.norm(samples.position, axis=1)) > 0.5
    rendered = CAMERA.render(samples.raw * gain, "standard", "daylight")
    assert np.median(np.abs(rendered - samples.srgb)) < 0.004
    assert set(samples.aperture) == {8.0}
