"""Photographs: the sensor measures the truth plus its noise, and the JPEG is the rendering of the RAW."""

from pathlib import Path

import exifread
import numpy as np
import OpenImageIO as oiio  # noqa: N813 -- the name that its own documentation uses
import pytest
import rawpy
from numpy.typing import NDArray

from lutforge.cli.demo_shots import SHOTS, demo_shots
from lutforge.colour.spectra import WAVELENGTHS, chart_reflectances, light, linear_srgb_under, surface_reflectances
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from lutforge.simulate.develop import BORDER, develop
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.dng import write_dng
from lutforge.simulate.photograph import develop_again, photograph, write_jpeg
from lutforge.simulate.scene import Scene
from lutforge.simulate.scenes import SCENES, chart_scene

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
        shifted = tuple(slice(s.start - b, s.stop - b) for s, b in zip(area, (BORDER // 2, BORDER), strict=True))
        np.testing.assert_allclose(jpeg[shifted].mean(axis=(0, 1)), truth, atol=1.2)
        halved = tuple(slice(s.start // 2 + 1, s.stop // 2) for s in shifted)
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
    assert first.dng.read_bytes() == again.dng.read_bytes() != other.dng.read_bytes()


def test_demo_shots_cover_styles_lights_and_both_kinds_of_jpeg(tmp_path: Path) -> None:
    told: list[str] = []
    shots = demo_shots(tmp_path, told.append, shape=(160, 240))
    assert len(told) == len(SHOTS) + 1
    assert len(shots.calibration) == len(SHOTS)
    assert {path.with_suffix(".JPG").exists() for path in shots.calibration} == {True, False}
    assert shots.held_out.jpeg is not None
    assert shots.held_out.dng not in shots.calibration
    camera = shots.camera
    spoilt, wanted = read_jpeg(shots.held_out.jpeg) / 255, read_jpeg(shots.right) / 255
    (style, balance), (new_style, new_balance) = shots.source.split("/"), shots.target.split("/")
    raw = camera.linearize(spoilt, style, balance)
    refinished = camera.render(raw, new_style, new_balance, shots.ev)
    unclipped = ((spoilt > 0.02) & (spoilt < 0.99)).all(axis=-1)
    assert unclipped.mean() > 0.7
    # What 8 bits, chroma subsampling and noise leave of it; before, the picture is far off.
    assert np.median(np.abs(refinished - wanted)[unclipped]) < 0.02
    assert np.median(np.abs(spoilt - wanted)[unclipped]) > 0.05
    assert {shot.style for shot in SHOTS} == {"standard", "vivid"}
    assert len({shot.white_balance for shot in SHOTS}) >= 4


# --- The DNG writer, against two independent readers: libraw (rawpy) and ExifRead -------------------------------------


@pytest.fixture(scope="module")
def mosaic() -> NDArray[np.uint16]:
    codes = np.random.default_rng(3).integers(600, 15521, (120, 182)).astype(np.uint16)
    codes[:4] = 15520
    return codes


@pytest.fixture(scope="module")
def preview(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    ramp = np.linspace(0, 255, 90 * 60 * 3).reshape(60, 90, 3).astype(np.uint8)
    path = tmp_path_factory.mktemp("preview") / "a.jpg"
    write_jpeg(path, ramp, nikon_d5100(), CameraSettings("vivid", subsampling="4:2:0"))
    return path.read_bytes()


@pytest.mark.parametrize("cfa", ["RGGB", "BGGR", "GRBG", "GBRG"])
@pytest.mark.parametrize("embedded", [True, False])
def test_libraw_reads_it(tmp_path: Path, mosaic: NDArray[np.uint16], preview: bytes, cfa: str, embedded: bool) -> None:
    path = tmp_path / "a.dng"
    jpeg = preview if embedded else None
    write_dng(path, mosaic, black=600, white=15520, cfa=cfa, as_shot_neutral=(0.5, 1.0, 0.625), preview_jpeg=jpeg)
    with rawpy.imread(str(path)) as raw:
        np.testing.assert_array_equal(raw.raw_image_visible, mosaic)
        assert raw.black_level_per_channel == [600] * 4
        assert raw.white_level == 15520
        np.testing.assert_allclose(raw.camera_whitebalance[:3], [2.0, 1.0, 1.6], rtol=1e-6)
        letters = [chr(raw.color_desc[index]) for index in np.ravel(np.asarray(raw.raw_pattern))]
        assert "".join(letters) == cfa
        if embedded:
            thumb = raw.extract_thumb()
            assert thumb.format == rawpy.ThumbFormat.JPEG
            # libraw may put its own Exif block in front; the picture data are ours, byte for byte.
            data = bytes(thumb.data)
            assert data[data.index(b"\xff\xdb") :] == preview[preview.index(b"\xff\xdb") :]
        else:
            with pytest.raises(rawpy.LibRawError):
                raw.extract_thumb()


@pytest.mark.parametrize(("orientation", "flip"), [(1, 0), (3, 3), (6, 6), (8, 5)])
def test_orientation_is_libraws_flip(tmp_path: Path, mosaic: NDArray[np.uint16], orientation: int, flip: int) -> None:
    write_dng(tmp_path / "a.dng", mosaic, orientation=orientation)
    with rawpy.imread(str(tmp_path / "a.dng")) as raw:
        assert raw.sizes.flip == flip


def test_exif_says_the_settings(tmp_path: Path, mosaic: NDArray[np.uint16], preview: bytes) -> None:
    path = tmp_path / "a.dng"
    write_dng(
        path, mosaic, make="LutForge", model="Simulated D5100", exposure_s=1 / 640, f_number=5.6, iso=200,
        light_source=10, saturation=2, profile_name="vivid", preview_jpeg=preview,
    )  # fmt: skip
    with path.open("rb") as file:
        tags = {key: str(value) for key, value in exifread.process_file(file, details=False).items()}
    told = {
        "Image Make": "LutForge", "Image Model": "Simulated D5100", "EXIF ExposureTime": "1/640",
        "EXIF ISOSpeedRatings": "200", "EXIF FNumber": "28/5", "EXIF LightSource": "Cloudy weather",
        "EXIF Saturation": "Hard",  # what ExifRead calls 2, "high saturation"
        "Image Tag 0xC6F8": "vivid",
    }  # fmt: skip
    assert {name: tags[name] for name in told} == told


# --- The camera's stages have the properties that the thesis assumes, and render inverts exactly ----------------------


CAMERAS = [nikon_d5100(), sigma_sd_merrill()]
CAMERA = pytest.mark.parametrize("camera", CAMERAS, ids=lambda camera: camera.model)
STYLES = pytest.mark.parametrize("style", ["standard", "vivid", "landscape"])


def balanced_colors(camera: SimulatedCamera, count: int = 30000) -> NDArray[np.float64]:
    """All white-balanced RAW values, and Ts of them: the domain of h."""
    return np.random.default_rng(5).random((count, 3)) @ camera.matrix.T


@CAMERA
def test_a_white_surface_is_neutral_under_every_white_balance(camera: SimulatedCamera) -> None:
    for name, balance in camera.white_balances.items():
        white = camera.expose(np.ones(len(WAVELENGTHS)), name)
        assert white.max() == pytest.approx(0.9)
        assert balance.multipliers[1] == 1.0
        assert min(balance.multipliers) >= 1.0
        for style in camera.styles:
            for level in (0.05, 0.2, 0.9):
                encoded = camera.render(level * white, style, name)
                assert np.ptp(encoded) < 1e-12
                assert 0 < encoded[0] < 1


@CAMERA
def test_the_matrix_keeps_white_and_sees_colours_nearly_as_people_do(camera: SimulatedCamera) -> None:
    np.testing.assert_allclose(camera.matrix.sum(axis=1), 1.0, atol=1e-12)
    surfaces = np.vstack([surface_reflectances(), chart_reflectances()])
    white = camera.expose(np.ones(len(WAVELENGTHS)), "daylight")
    estimated = camera.expose(surfaces, "daylight") / white @ camera.matrix.T
    true = linear_srgb_under(surfaces, light(5200.0))
    assert np.sqrt(np.mean((estimated - true) ** 2)) < 0.035
    neutral = light(6504.0) @ camera.sensitivity
    white = camera.color_matrix() @ [0.95047, 1.0, 1.08883]
    np.testing.assert_allclose(white, neutral / neutral[1], rtol=1e-3)


@CAMERA
@STYLES
def test_linearize_inverts_render(camera: SimulatedCamera, style: str) -> None:
    raw = np.random.default_rng(1).random((40, 500, 3)) / camera.multipliers("tungsten") / 2**0.5
    encoded = camera.render(raw, style, "tungsten", ev=0.5)
    assert encoded.min() >= 0 and encoded.max() <= 1
    unclipped = ((encoded > 0) & (encoded < 1)).all(axis=-1)
    assert unclipped.mean() > 0.6
    back = camera.linearize(encoded, style, "tungsten", ev=0.5)
    np.testing.assert_allclose(back[unclipped], raw[unclipped], atol=1e-9)


@CAMERA
@STYLES
def test_low_saturations_do_not_move(camera: SimulatedCamera, style: str) -> None:
    rng = np.random.default_rng(2)
    largest = rng.uniform(0.01, 1.0, (20000, 1))
    colors = largest * (1 - 0.15 * rng.random((20000, 3)))
    np.testing.assert_allclose(camera.styles[style][0](colors), colors, atol=1e-12)


@CAMERA
@STYLES
def test_the_gamut_map_is_smooth_and_never_folds(camera: SimulatedCamera, style: str) -> None:
    h, colors, step = camera.styles[style][0], balanced_colors(camera), 1e-6
    shifts = step * np.eye(3)
    jacobian = np.stack([(h(colors + d) - h(colors - d)) / (2 * step) for d in shifts], axis=-1)
    assert np.linalg.det(jacobian).min() > 0
    assert np.linalg.norm(jacobian, ord=2, axis=(1, 2)).max() < 6


@CAMERA
@STYLES
def test_surfaces_fit_the_cube_and_vivid_moves_them(camera: SimulatedCamera, style: str) -> None:
    surfaces = camera.expose(np.vstack([surface_reflectances(), chart_reflectances()]), "daylight")
    linear = surfaces * camera.multipliers("daylight") @ camera.matrix.T
    mapped = camera.styles[style][0](linear)
    assert mapped.min() > 0 and mapped.max() < 1
    if style == "vivid":
        assert np.linalg.norm(mapped - linear, axis=-1).max() > 0.05
