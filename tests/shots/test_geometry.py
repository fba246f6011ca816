"""JPEGs that the camera straightened: the lens is found, and samples are as good as those of an unbent picture."""

import math
import shutil
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.ndimage import map_coordinates

from lutforge.calibration.options import CalibrationOptions
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.inspection import inspect
from lutforge.pipeline.kit_checks import compare_with_jpeg
from lutforge.pipeline.sampling import sample
from lutforge.samples.extract import extract, places_in_picture
from lutforge.shots.geometry import Distortion
from lutforge.shots.read import EMBEDDED, Shot, read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scene import Scene
from lutforge.simulate.scenes import SCENES
from tests.cases.lenses import displacements

SHAPE = (404, 608)
MIDDLE, RADIUS = (304.0, 202.0), math.hypot(*SHAPE) / 2


def lens(k1: float = 0.0, k2: float = 0.0, x: float = 0.0, y: float = 0.0, **fringes: float) -> Distortion:
    """A lens whose centre is off the sensor's by shares of half its diagonal."""
    return Distortion(MIDDLE[0] + RADIUS * x, MIDDLE[1] + RADIUS * y, RADIUS, k1, k2, **fringes)


@cache
def scene() -> Scene:
    return SCENES["still-life"](*SHAPE, 0)


def shot_of(folder: Path, distortion: Distortion | None) -> Shot:
    camera = nikon_d5100()
    settings = CameraSettings(exposure_s=camera.nominal_exposure_s, distortion=distortion)
    return read_shot(photograph(camera, scene(), settings, folder, "shot").dng)


def error(shot: Shot) -> float:
    """The mean error of the samples' JPEG colours, against what the camera makes of their RAW."""
    samples = extract(shot).samples
    rendered = nikon_d5100().render(samples.raw, "standard", "daylight")
    return float(np.linalg.norm(rendered - samples.srgb, axis=1).mean())


@pytest.mark.parametrize(
    "drawn",
    [
        pytest.param(lens(-0.06), id="barrel"),
        pytest.param(lens(0.06), id="pincushion", marks=pytest.mark.slow),
        pytest.param(lens(-0.02), id="weak", marks=pytest.mark.slow),
        pytest.param(lens(-0.15), id="strong", marks=pytest.mark.slow),
        pytest.param(lens(-0.08, 0.07), id="moustache", marks=pytest.mark.slow),
        pytest.param(lens(-0.06, x=0.03, y=-0.02), id="off-centre", marks=pytest.mark.slow),
        pytest.param(lens(red=0.002, blue=-0.001), id="fringes"),
    ],
)
def test_samples_of_straightened_pictures_are_as_good(drawn: Distortion, tmp_path: Path) -> None:
    plain, bent = shot_of(tmp_path, None), shot_of(tmp_path, drawn)
    assert plain.before_straightening is None
    assert not plain.lens_note
    found = bent.placement.registration.distortion
    assert found is not None
    # Where the lens draws a place of the straight picture, up to a zoom, within half a RAW pixel: a quarter of a JPEG's
    # at half size; red and blue within a quarter of what they are off.
    assert np.abs(displacements(found, drawn, *SHAPE)).max() < 0.5
    assert found.red == pytest.approx(drawn.red, abs=5e-4)
    assert found.blue == pytest.approx(drawn.blue, abs=5e-4)
    assert error(bent) < 1.1 * error(plain)


@pytest.mark.slow
def test_straightened_photographs_calibrate_as_well(shared_data: Path, tmp_path: Path) -> None:
    """Five previews, resampled at r (1 − 0.06 r²) to fill their frame; as they are, none is told to be straightened."""
    shots = [Path(shutil.copy(raw, tmp_path)) for raw in (shared_data / "canon_powershot_s40").glob("*.CRW")]
    plain = calibrate(sample(shots), CalibrationOptions(size=17)).styles["standard"].errors
    for raw in shots:
        read = read_shot(raw)
        assert not read.lens_note
        height, width = read.jpeg.shape[:2]
        middle, half = np.array([width, height]) / 2, math.hypot(width, height) / 2
        away = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1) - middle
        bent = 1 - 0.06 * np.square(away / half).sum(axis=-1, keepdims=True)
        x, y = np.moveaxis(away * bent / bent[0, width // 2] + middle - 0.5, -1, 0)
        planes = [map_coordinates(plane, [y, x], mode="nearest") for plane in np.moveaxis(read.jpeg, -1, 0)]
        Image.fromarray(np.stack(planes, axis=-1)).save(raw.with_suffix(".JPG"), quality=98, subsampling=0)
    assert "barrel" in read_shot(shots[0]).lens_note
    straightened = calibrate(sample(shots), CalibrationOptions(size=17)).styles["standard"].errors
    for figure in ("render_mean", "linearize_mean"):
        assert straightened[figure] < 1.1 * plain[figure]


def test_a_crop_of_a_straightened_picture_is_found(tmp_path: Path) -> None:
    """A digital crop to 16:9, and a square off the middle."""
    whole = shot_of(tmp_path, lens(-0.06))
    path = tmp_path / "shot.JPG"
    with Image.open(path) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    for rows, columns in ((slice(33, 366), slice(0, 592)), (slice(0, 400), slice(150, 550))):
        Image.fromarray(pixels[rows, columns]).save(path, quality=95, subsampling=0)
        cropped = read_shot(tmp_path / "shot.dng")
        assert cropped.jpeg.shape == pixels[rows, columns].shape
        corner = np.array([[columns.start, rows.start]], dtype=np.float64)
        inner = np.array([[50.0, 50.0], [250.0, 150.0], [350.0, 300.0]])
        there = whole.placement.registration.on_raw(inner + corner)
        here = cropped.placement.registration.on_raw(inner)
        np.testing.assert_allclose(here, there, atol=0.5)


def test_other_shots_start_where_the_first_one_lies(tmp_path: Path) -> None:
    first = shot_of(tmp_path, lens(-0.06))
    second = read_shot(tmp_path / "shot.dng", expected=lambda: first.placement)
    assert second.placement.registration.distortion == first.placement.registration.distortion
    zoomed = shot_of(tmp_path, lens(0.04))
    again = read_shot(tmp_path / "shot.dng", expected=lambda: first.placement)
    found, alone = (shot.placement.registration.distortion for shot in (again, zoomed))
    assert found is not None
    assert alone is not None
    assert found.k1 + found.k2 == pytest.approx(alone.k1 + alone.k2, abs=0.002)


def test_it_is_told(tmp_path: Path) -> None:
    shot = shot_of(tmp_path, lens(-0.06, red=0.002, blue=-0.001))
    note = "barrel distortion of -6.0 % in the corners, red +0.2"
    assert note.split(",")[0].split(" of")[0] in shot.lens_note
    rows = dict(inspect(tmp_path / "shot.dng").rows)
    assert rows["lens"] == shot.lens_note
    assert shot.lens_note in extract(shot).notes


def test_places_of_samples_are_where_the_lens_drew_them(tmp_path: Path) -> None:
    """So that vignetting, which darkens the RAW, is where it is; a tile near the corner moves by over a pixel in 30."""
    shot = shot_of(tmp_path, lens(-0.06))
    corner = np.array([[10.0, 10.0]])
    registration = shot.placement.registration
    there = places_in_picture(shot, corner)[0] * RADIUS + MIDDLE
    np.testing.assert_allclose(there, registration.on_raw(corner)[0])
    flat = replace(registration, distortion=None).on_raw(corner)[0]
    assert np.linalg.norm(there - flat) > 5


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.02, 0.05, 0.15])
def test_a_straightened_perspective_is_named(share: float, tmp_path: Path) -> None:
    """A keystone, in shares of the width, is nothing that a lens does: the preview, which has none, takes its place."""
    shot_of(tmp_path, None)
    path = tmp_path / "shot.JPG"
    developed = Path(shutil.copy(path, tmp_path / "developed.jpg"))
    with Image.open(path) as picture:
        width, height = picture.size
        edge = share * width / 2
        corners = np.array([[edge, 0], [0, height], [width, height], [width - edge, 0]])
        # Of each corner of the new picture, the place in the old one, as a projective map (8 numbers).
        to = np.array([[0, 0], [0, height], [width, height], [width, 0]])
        zero = np.zeros((4, 3))
        new = np.column_stack([to, np.ones(4)])
        rows = np.vstack([np.hstack([new, zero]), np.hstack([zero, new])])
        design = np.column_stack([rows, -np.vstack([to, to]) * corners.T.reshape(-1, 1)])
        found = np.linalg.solve(design, corners.T.ravel())
        warped = picture.transform(picture.size, Image.Transform.PERSPECTIVE, found.tolist(), Image.Resampling.BICUBIC)
        warped.save(path, quality=95, subsampling=0, exif=picture.getexif())
    shot = read_shot(tmp_path / "shot.dng")
    assert shot.jpeg_source == EMBEDDED
    reason = next(note for note in shot.metadata.notes if note.startswith("passed over"))
    assert "not lie on their place" in reason
    # What a program developed has tones of its own, by which a JPEG may seem distorted: it is compared all the same.
    assert compare_with_jpeg(tmp_path / "shot.dng", developed).tiles > 100


def test_developed_pictures_are_compared_where_the_lens_drew_them(tmp_path: Path) -> None:
    """The camera's own JPEG, handed in as what a program developed of a bent RAW, has no error."""
    shot_of(tmp_path, lens(-0.06, red=0.002))
    (tmp_path / "shot.JPG").rename(tmp_path / "same.jpg")
    (tmp_path / "shot.JPG").write_bytes((tmp_path / "same.jpg").read_bytes())
    check = compare_with_jpeg(tmp_path / "shot.dng", tmp_path / "same.jpg")
    assert check.tiles > 100
    assert check.maximum < 0.1
