"""Photographs: the sensor measures the truth plus its noise, and the JPEG is the rendering of the RAW."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
import pytest
import rawpy
from numpy.typing import NDArray

from lutforge.cli.demo_shots import SHOTS, demo_shots
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.develop import BORDER, develop
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import develop_again, photograph
from lutforge.simulate.scene import Scene
from lutforge.simulate.scenes import SCENES, chart_scene
from tests.cases.same_bytes import same_bytes

HEIGHT, WIDTH = 248, 376


def read_jpeg(path: Path) -> NDArray[np.uint8]:
    buffer = oiio.ImageBuf(str(path))
    pixels: NDArray[np.uint8] = np.asarray(buffer.get_pixels("uint8"), dtype=np.uint8)
    return pixels


@pytest.fixture(scope="module")
def chart() -> Scene:
    return chart_scene(HEIGHT, WIDTH, seed=4)


def patch_areas(scene: Scene) -> list[tuple[slice, slice]]:
    half = 0.3 * scene.patch_side
    spans = [[slice(int(at - half), int(at + half) + 1) for at in place] for place in scene.patches]
    return [(rows, columns) for columns, rows in spans]


@pytest.mark.parametrize("name", SCENES)
def test_scenes_are_deterministic_and_valid(name: str) -> None:
    first, again, other = (SCENES[name](HEIGHT, WIDTH, seed) for seed in (1, 1, 2))
    assert first.shape == (HEIGHT, WIDTH)
    for shares in (first.reflectances, first.mix):
        assert shares.min() >= 0 and shares.max() <= 1
    assert first.shade.min() > 0
    irradiance = first.irradiance(nikon_d5100(), "daylight")
    np.testing.assert_array_equal(irradiance, again.irradiance(nikon_d5100(), "daylight"))
    assert np.abs(irradiance - other.irradiance(nikon_d5100(), "daylight")).max() > 0.1


def test_libraw_measures_the_charts_patches(tmp_path: Path, chart: Scene) -> None:
    camera = nikon_d5100()
    settings = CameraSettings("vivid", "tungsten", camera.nominal_exposure_s)
    shot = photograph(camera, chart, settings, tmp_path, "chart")
    truth = chart.irradiance(camera, "tungsten", settings.exposure_s)
    with rawpy.imread(str(shot.dng)) as raw:
        as_shot = np.array(raw.camera_whitebalance[:3]) / raw.camera_whitebalance[1]
        np.testing.assert_allclose(as_shot, camera.multipliers("tungsten"), rtol=1e-5)
        image = raw.postprocess(
            gamma=(1, 1), no_auto_bright=True, adjust_maximum_thr=0.0, user_wb=[1, 1, 1, 1], output_bps=16,
            output_color=rawpy.ColorSpace.raw, user_flip=0,
        )  # fmt: skip
    measured = image / 65535
    for area in patch_areas(chart):
        pixels = measured[area].reshape(-1, 3)
        error = 5 * pixels.std(axis=0) / np.sqrt(len(pixels)) + 2e-4
        assert (np.abs(pixels.mean(axis=0) - truth[area].mean(axis=(0, 1))) < error).all()


@pytest.mark.parametrize("style", ["standard", "vivid"])
def test_the_jpeg_is_the_rendering_of_the_raw(tmp_path: Path, chart: Scene, style: str) -> None:
    camera = nikon_d5100()
    settings = CameraSettings(style, "daylight", camera.nominal_exposure_s, subsampling="4:4:4")
    shot = photograph(camera, chart, settings, tmp_path, "chart")
    assert shot.jpeg is not None
    jpeg = read_jpeg(shot.jpeg)
    assert jpeg.shape == (HEIGHT - BORDER, WIDTH - 2 * BORDER, 3)
    with rawpy.imread(str(shot.dng)) as raw:
        developed = develop(camera, raw.raw_image_visible.copy(), settings)
        preview = bytes(raw.extract_thumb().data)
    difference = jpeg.astype(float) - developed
    assert np.sqrt(np.mean(difference**2)) < 3
    rendered = camera.render(chart.irradiance(camera, "daylight"), style, "daylight")
    (tmp_path / "preview.jpg").write_bytes(preview)
    small = read_jpeg(tmp_path / "preview.jpg")
    assert small.shape == (jpeg.shape[0] // 2, jpeg.shape[1] // 2, 3)
    for area in patch_areas(chart):
        truth = 255 * rendered[area].mean(axis=(0, 1))
        rows, columns = area
        rows = slice(rows.start - BORDER // 2, rows.stop - BORDER // 2)
        columns = slice(columns.start - BORDER, columns.stop - BORDER)
        np.testing.assert_allclose(jpeg[rows, columns].mean(axis=(0, 1)), truth, atol=1.2)
        halved = tuple(slice(side.start // 2 + 1, side.stop // 2) for side in (rows, columns))
        np.testing.assert_allclose(small[halved].mean(axis=(0, 1)), truth, atol=2.0)


def test_the_jpeg_says_its_settings(tmp_path: Path, chart: Scene) -> None:
    camera = nikon_d5100()
    settings = CameraSettings("vivid", "shade", 1 / 90, iso=400, orientation=6)
    shot = photograph(camera, chart, settings, tmp_path, "chart", light="cloudy")
    spec = oiio.ImageBuf(str(shot.jpeg)).spec()
    assert (spec["Make"], spec["Model"], spec["Orientation"]) == (camera.make, camera.model, 6)
    assert spec["ImageDescription"] == "PictureStyle=vivid; WhiteBalance=shade"
    assert spec["ExposureTime"] == pytest.approx(1 / 90, rel=1e-4)
    assert (spec["Exif:LightSource"], spec["Exif:Saturation"]) == (11, 2)


def test_developing_again_changes_the_rendering_only(tmp_path: Path, chart: Scene) -> None:
    camera, settings = nikon_d5100(), CameraSettings("standard", "tungsten", 1 / 120)
    shot = photograph(camera, chart, settings, tmp_path, "chart", light="daylight")
    again = develop_again(camera, shot, settings, tmp_path / "again.JPG")
    assert shot.jpeg is not None
    np.testing.assert_array_equal(read_jpeg(again), read_jpeg(shot.jpeg))
    right = CameraSettings("standard", "daylight", 1 / 120, push_ev=1.0)
    pixels = read_jpeg(develop_again(camera, shot, right, tmp_path / "right.JPG"))
    area = patch_areas(chart)[19]  # a light neutral: now neutral in the JPEG
    assert np.ptp(pixels[area[0], area[1]].mean(axis=(0, 1))) < 3


def test_the_same_name_and_seed_give_the_same_file(tmp_path: Path, chart: Scene) -> None:
    camera, settings = nikon_d5100(), CameraSettings()
    first = photograph(camera, chart, settings, tmp_path / "a", "shot", jpeg_beside=False)
    again = photograph(camera, chart, settings, tmp_path / "b", "shot", jpeg_beside=False)
    other = photograph(camera, chart, settings, tmp_path / "c", "shot", jpeg_beside=False, seed=1)
    assert first.jpeg is None
    assert same_bytes(first.dng, again.dng)
    assert not same_bytes(first.dng, other.dng)


def test_demo_shots_cover_styles_lights_and_both_kinds_of_jpeg(tmp_path: Path) -> None:
    told: list[str] = []
    shots = demo_shots(tmp_path, told.append, shape=(160, 240))
    assert len(told) == len(SHOTS) + 1
    assert len(shots.calibration) == len(SHOTS)
    assert {path.with_suffix(".JPG").exists() for path in shots.calibration} == {True, False}
    assert shots.held_out.jpeg is not None
    assert shots.held_out.dng not in shots.calibration
    camera = shots.camera
    spoilt, expected = read_jpeg(shots.held_out.jpeg) / 255, read_jpeg(shots.right) / 255
    (style, balance), (new_style, new_balance) = shots.source.split("/"), shots.target.split("/")
    raw = camera.linearize(spoilt, style, balance)
    refinished = camera.render(raw, new_style, new_balance, shots.ev)
    unclipped = ((spoilt > 0.02) & (spoilt < 0.99)).all(axis=-1)
    assert unclipped.mean() > 0.7
    # What 8 bits, chroma subsampling and noise leave of it; before, the picture is far off.
    assert np.median(np.abs(refinished - expected)[unclipped]) < 0.02
    assert np.median(np.abs(spoilt - expected)[unclipped]) > 0.05
    assert {shot.style for shot in SHOTS} == {"standard", "vivid"}
    assert len({shot.white_balance for shot in SHOTS}) >= 4
