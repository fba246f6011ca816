"""Pictures come out upright: all eight orientations of EXIF, of every kind of file, wherever a picture is read."""

import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageOps

from lutforge.grading.batch import apply_batch
from lutforge.grading.grade import LutRecipe
from lutforge.grading.profile_recipe import ProfileRecipe
from lutforge.images.orientation import inverse, orientation_between, upright, upright_places
from lutforge.images.raw import read_preview, read_raw
from lutforge.images.read import read_image
from lutforge.images.tiff import read_directory
from lutforge.images.write import write_image
from lutforge.pipeline.kit_checks import compare_with_jpeg
from lutforge.pipeline.photographs import open_photograph, picture_bytes, raw_picture_bytes, read_small, thumbnail
from lutforge.samples.extract import extract
from lutforge.shots.read import MIRROR_IMAGE, read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import still_life
from tests.cases.pictures import write_cube
from tests.cases.profiles import plain_profile

ORIENTATIONS = range(1, 9)


@pytest.fixture(scope="module")
def shot(tmp_path_factory: pytest.TempPathFactory) -> tuple[bytes, bytes]:
    """A DNG file without a preview and its JPEG, both as the sensor has them."""
    folder = tmp_path_factory.mktemp("shot")
    settings = CameraSettings("standard", "daylight", 1 / 30)
    made = photograph(nikon_d5100(), still_life(448, 664, seed=1), settings, folder, "a")
    assert made.jpeg is not None
    return made.dng.read_bytes(), made.jpeg.read_bytes()


@pytest.fixture(scope="module")
def raw_alone(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """A DNG file with a preview, as the sensor has it."""
    settings = CameraSettings("standard", "daylight", 1 / 30)
    folder = tmp_path_factory.mktemp("alone")
    scene = still_life(448, 664, seed=1)
    return photograph(nikon_d5100(), scene, settings, folder, "a", jpeg_beside=False).dng.read_bytes()


def oriented_raw(data: bytes, orientation: int) -> bytes:
    """A little-endian TIFF file whose tag Orientation is another."""
    entries, _ = read_directory(data, "<", struct.unpack_from("<I", data, 4)[0])
    at = entries[274].place.start
    return data[:at] + struct.pack("<H", orientation) + data[at + 2 :]


def shown(path: Path) -> NDArray[np.float64]:
    """A picture (h, w, 3) in [0, 1] as Pillow shows it, which reads Orientation by itself."""
    with Image.open(path) as picture:
        return np.asarray(ImageOps.exif_transpose(picture).convert("RGB")) / 255.0


def corners() -> NDArray[np.uint8]:
    """A picture (48, 64, 3) of four quarters, each of another colour."""
    colours = np.array([[[200, 40, 40], [40, 180, 60]], [[50, 60, 190], [220, 210, 90]]], np.uint8)
    return np.repeat(np.repeat(colours, 24, axis=0), 32, axis=1)


def write_oriented(path: Path, orientation: int) -> None:
    """`corners`, with a tag that says how it lies."""
    picture = Image.fromarray(corners())
    exif = Image.Exif()
    exif[274] = orientation
    if path.suffix == ".heic":
        heif = pytest.importorskip("pillow_heif", reason="needs the optional package pillow-heif")
        heif.from_pillow(picture).save(str(path), quality=95, exif=exif.tobytes())
    elif path.suffix == ".tif":
        picture.save(path, tiffinfo={274: orientation})
    else:
        picture.save(path, exif=exif, quality=95) if path.suffix == ".jpg" else picture.save(path, exif=exif)


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_orientations_undo_each_other(orientation: int) -> None:
    stored = np.arange(24).reshape(2, 4, 3)
    turned = upright(stored, orientation)
    np.testing.assert_array_equal(upright(turned, inverse(orientation)), stored)
    assert orientation_between(stored, turned) == orientation
    at = np.argwhere(np.ones(stored.shape[:2]))
    places = (at[:, ::-1] + 0.5) / (4, 2)
    x, y = np.floor(upright_places(places, orientation) * turned.shape[1::-1]).astype(int).T
    np.testing.assert_array_equal(turned[y, x], stored[at[:, 0], at[:, 1]])


@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_raw_files_are_rendered_upright(tmp_path: Path, shot: tuple[bytes, bytes], orientation: int) -> None:
    plain_profile("LutForge Simulated D5100").save(tmp_path / "camera.npz")
    (tmp_path / "a.dng").write_bytes(shot[0])
    (tmp_path / "b.dng").write_bytes(oriented_raw(shot[0], orientation))
    recipe = ProfileRecipe((tmp_path / "camera.npz",), target="standard/daylight")
    result = apply_batch(recipe, [tmp_path / "a.dng", tmp_path / "b.dng"], tmp_path / "out", ".tif")
    assert not result.failed
    plain, turned = (read_image(done.target) for done in result.done)
    np.testing.assert_array_equal(turned.pixels, upright(plain.pixels, orientation))
    assert turned.spec.get_int_attribute("Orientation", 1) == 1
    # Nothing else of the file is read otherwise
    first, second = read_raw(tmp_path / "a.dng"), read_raw(tmp_path / "b.dng")
    assert second.orientation == orientation
    assert first.d65 is not None and second.d65 is not None
    np.testing.assert_array_equal(first.d65, second.d65)
    np.testing.assert_array_equal(first.pixels, second.pixels)


@pytest.mark.parametrize("suffix", ["jpg", "tif", "png", "heic"])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_pictures_are_graded_upright(tmp_path: Path, suffix: str, orientation: int) -> None:
    source = tmp_path / f"a.{suffix}"
    write_oriented(source, orientation)
    expected = upright(corners() / 255.0, orientation)
    write_cube(tmp_path / "same.cube", gamma=1.0)
    grade = LutRecipe(tmp_path / "same.cube").grade(source).processor
    pixels = np.ascontiguousarray(expected, dtype=np.float32)
    grade.applyRGB(pixels)
    plain_profile("Camera").save(tmp_path / "camera.npz")
    profile = ProfileRecipe((tmp_path / "camera.npz",), source="standard/daylight", target="standard/daylight")
    for target in (".jpg", ".tif", ".png", ".webp", ".bmp"):
        by_lut = apply_batch(LutRecipe(tmp_path / "same.cube"), [source], tmp_path / "lut", target)
        by_profile = apply_batch(profile, [source], tmp_path / "profile", target)
        assert not by_lut.failed and not by_profile.failed
        for done, turned in ((by_lut.done[0], pixels), (by_profile.done[0], expected)):
            after = shown(done.target)
            assert after.shape == expected.shape
            assert np.median(np.abs(after - turned)) < 0.02


@pytest.mark.parametrize("suffix", ["jpg", "tif", "png", "heic"])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_studio_shows_pictures_upright(tmp_path: Path, suffix: str, orientation: int) -> None:
    path = tmp_path / f"a.{suffix}"
    write_oriented(path, orientation)
    expected = upright(corners() / 255.0, orientation)
    small = read_small(path, 1_000_000)
    assert small.shape == expected.shape
    assert np.median(np.abs(small - expected)) < 0.02
    with Image.open(BytesIO(picture_bytes(path))) as picture:
        assert picture.format in ("JPEG", "PNG")
        assert picture.format == "JPEG" or picture.getexif().get(274, 1) == 1  # not all browsers turn PNG files
        sent = np.asarray(ImageOps.exif_transpose(picture).convert("RGB")) / 255.0
    assert sent.shape == expected.shape
    assert np.median(np.abs(sent - expected)) < 0.02


@pytest.mark.parametrize("beside", ["", "upright", "tagged"])
@pytest.mark.parametrize("orientation", ORIENTATIONS)
def test_the_studio_shows_raw_files_upright(tmp_path: Path, raw_alone: bytes, orientation: int, beside: str) -> None:
    """By the preview inside, or by the JPEG beside it, turned already or by its tag: in thumbnails and as a look."""
    path = tmp_path / "a.dng"
    path.write_bytes(oriented_raw(raw_alone, orientation))
    lying = np.asarray(Image.open(BytesIO(read_preview(path)[0])).convert("RGB"))
    expected = upright(lying, orientation)
    if beside == "upright":
        Image.fromarray(expected).save(tmp_path / "a.jpg", quality=95)
    elif beside == "tagged":
        exif = Image.Exif()
        exif[274] = orientation
        Image.fromarray(lying).save(tmp_path / "a.jpg", quality=95, exif=exif)

    look = open_photograph(path, plain_profile("LutForge Simulated D5100"), lambda stage, share: None)
    for picture in (raw_picture_bytes(path), look.picture, thumbnail(path)):
        shown_by_browser = ImageOps.exif_transpose(Image.open(BytesIO(picture))).convert("RGB")
        size = shown_by_browser.size
        assert abs(size[0] / size[1] - expected.shape[1] / expected.shape[0]) < 0.02
        small = np.asarray(Image.fromarray(expected).resize(size, Image.Resampling.BOX), dtype=np.float64)
        assert np.abs(np.asarray(shown_by_browser) - small).mean() < 6


@pytest.mark.parametrize(
    ("orientation", "mirrored"), [*((number, False) for number in ORIENTATIONS), (1, True), (6, True)]
)
def test_shots_are_paired_and_shown_upright(
    tmp_path: Path, shot: tuple[bytes, bytes], orientation: int, mirrored: bool
) -> None:
    (tmp_path / "a.dng").write_bytes(oriented_raw(shot[0], orientation))
    with Image.open(BytesIO(shot[1])) as jpeg:
        stored = np.asarray(jpeg)
    lying = upright(stored, orientation)
    lying = np.ascontiguousarray(lying[:, ::-1]) if mirrored else lying
    Image.fromarray(lying).save(tmp_path / "a.jpg", quality=95)
    made = read_shot(tmp_path / "a.dng")
    assert made.jpeg_source.endswith("a.jpg")
    with Image.open(tmp_path / "a.jpg") as jpeg:
        decoded = np.asarray(jpeg)
    decoded = decoded[:, ::-1] if mirrored else decoded
    np.testing.assert_array_equal(made.jpeg, upright(np.ascontiguousarray(decoded), inverse(orientation)))
    assert (MIRROR_IMAGE in made.metadata.notes) == (mirrored and orientation not in (2, 4, 5, 7))
    # The report and the studio show cells of both, as the RAW file says
    cells = extract(made).cells
    assert cells is not None
    picture = cells.picture
    shape = picture.shape[1::-1]
    small = np.asarray(Image.fromarray(np.ascontiguousarray(decoded)).resize(shape, Image.Resampling.BOX))
    assert np.abs(picture.astype(float) - small).mean() < 4


@pytest.mark.parametrize(
    "orientation",
    [number if number in (2, 6) else pytest.param(number, marks=pytest.mark.slow) for number in ORIENTATIONS],
)
def test_developments_of_kits_are_compared_upright(tmp_path: Path, shot: tuple[bytes, bytes], orientation: int) -> None:
    (tmp_path / "a.dng").write_bytes(oriented_raw(shot[0], orientation))
    (tmp_path / "a.jpg").write_bytes(shot[1])  # as the sensor has it
    picture = read_image(tmp_path / "a.jpg")
    write_image(tmp_path / "by_program.png", upright(picture.pixels, orientation), picture)
    assert compare_with_jpeg(tmp_path / "a.dng", tmp_path / "by_program.png").mean < 0.5
