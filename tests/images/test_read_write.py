"""Images through OpenImageIO: what a file says about itself survives, and bad files give one clear line."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from numpy.typing import NDArray
from PIL import ImageCms

from lutforge.errors import ImageError
from lutforge.images.orientation import upright
from lutforge.images.read import Image, is_premultiplied, read_image
from lutforge.images.write import write_image

PROFILE = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()


def ramp(height: int = 40, width: int = 64, channels: int = 3) -> NDArray[np.float32]:
    y, x = np.mgrid[0:height, 0:width]
    planes = [x / (width - 1), y / (height - 1), (x + y) / (width + height - 2), 0.25 + 0.5 * x / width]
    return np.stack(planes[:channels], axis=-1).astype(np.float32)


def source(kind: str = "uint8", channels: int = 3, orientation: int = 1) -> Image:
    spec = oiio.ImageSpec(64, 40, channels, kind)
    spec.attribute("Make", "Canon")
    spec.attribute("Model", "Canon PowerShot S40")
    spec.attribute("ExposureTime", 0.01)
    spec.attribute("Exif:FocalLength", 7.0938)
    spec.attribute("Copyright", "someone")
    spec.attribute("IPTC:City", "Singapore")
    spec.attribute("Orientation", orientation)
    spec.attribute("thumbnail_width", 160)
    spec.attribute("ICCProfile", oiio.TypeDesc(f"uint8[{len(PROFILE)}]"), PROFILE)
    return Image(ramp(channels=channels), spec)


@pytest.mark.parametrize(
    ("suffix", "kind", "expected", "tolerance"),
    [
        (".jpg", "uint8", "uint8", 4 / 255),
        (".png", "uint8", "uint8", 0.5 / 255),
        (".png", "uint16", "uint16", 0.5 / 65535),
        (".png", "half", "uint16", 0.5 / 65535),
        (".tif", "uint8", "uint8", 0.5 / 255),
        (".tif", "uint16", "uint16", 0.5 / 65535),
        (".tif", "half", "float", 0.0),  # OpenImageIO writes no half TIFF
        (".tif", "float", "float", 0.0),
        (".exr", "half", "half", 2.5e-4),
        (".exr", "float", "float", 0.0),
        (".exr", "uint16", "float", 0.0),
        (".dpx", "uint16", "uint16", 0.5 / 65535),
    ],
)
def test_bit_depth_is_kept_if_possible(tmp_path: Path, suffix: str, kind: str, expected: str, tolerance: float) -> None:
    path = tmp_path / f"a{suffix}"
    write_image(path, ramp(), source(kind))
    image = read_image(path)
    assert image.spec.format == expected
    assert image.pixels.dtype == np.float32
    np.testing.assert_allclose(image.pixels, ramp(), atol=tolerance * 1.01 + 1e-7)


@pytest.mark.parametrize("suffix", [".jpg", ".tif", ".png"])
def test_metadata_and_profile_survive(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"a{suffix}"
    write_image(path, ramp(), source(orientation=6), note="standard/daylight to\nvivid/shade")
    spec = read_image(path).spec
    assert spec.get_string_attribute("Model") == "Canon PowerShot S40"
    assert spec.get_float_attribute("ExposureTime") == pytest.approx(0.01, rel=1e-3)
    assert spec.get_float_attribute("Exif:FocalLength") == pytest.approx(7.0938, rel=1e-3)
    assert spec.get_int_attribute("Orientation") == 6
    assert bytes(spec.getattribute("ICCProfile")) == PROFILE
    assert spec.get_string_attribute("Software") == "LutForge"
    if suffix != ".tif":  # OpenImageIO's TIFF writer has no such tag
        assert spec.get_string_attribute("Exif:ImageHistory") == "standard/daylight to vivid/shade"
    if suffix != ".png":
        assert spec.get_string_attribute("IPTC:City") == "Singapore"
    assert (spec.width, spec.height) == (64, 40)


def test_jpeg_keeps_full_chroma(tmp_path: Path) -> None:
    checker = np.zeros((64, 64, 3), np.float32)
    checker[:, ::2] = (0.8, 0.2, 0.2)
    checker[:, 1::2] = (0.2, 0.2, 0.8)
    path = tmp_path / "a.jpg"
    write_image(path, checker, source())
    assert np.abs(read_image(path).pixels - checker).mean() < 0.02  # 4:2:0 averages neighbours: 0.2


@pytest.mark.parametrize("subsampling", ["4:4:4", "4:2:2", "4:2:0"])
@pytest.mark.parametrize("quality", [70, 92, 98])
def test_a_jpeg_of_a_jpeg_is_as_fine_as_its_source(tmp_path: Path, quality: int, subsampling: str) -> None:
    noise = np.random.default_rng(1).uniform(0.2, 0.8, (240, 320, 3)).astype(np.float32)
    spec = oiio.ImageSpec(320, 240, 3, "uint8")
    spec.attribute("Compression", f"jpeg:{quality}")
    spec.attribute("jpeg:subsampling", subsampling)
    output = oiio.ImageOutput.create("a.jpg")
    assert output is not None
    assert output.open(str(tmp_path / "a.jpg"), spec)
    assert output.write_image(noise)
    assert output.close()
    picture = read_image(tmp_path / "a.jpg")
    write_image(tmp_path / "b.jpg", picture.pixels, picture)
    written = read_image(tmp_path / "b.jpg")
    assert written.spec.get_string_attribute("jpeg:subsampling") == subsampling
    assert written.spec.get_int_attribute("jpeg:quality") == picture.spec.get_int_attribute("jpeg:quality") == quality
    sizes = [(tmp_path / name).stat().st_size for name in ("a.jpg", "b.jpg")]
    assert sizes[1] == pytest.approx(sizes[0], rel=0.1)  # white noise, once more averaged
    write_image(tmp_path / "c.png", picture.pixels, picture)
    assert read_image(tmp_path / "c.png").spec.getattribute("jpeg:quality") is None


def test_dates_have_exif_s_form(tmp_path: Path) -> None:
    image = source()
    image.spec.attribute("DateTime", "2020-02-18T08:56:13.29-07:00")
    image.spec.attribute("Exif:DateTimeOriginal", "2020:02:18 08:56:13")
    write_image(tmp_path / "a.jpg", ramp(), image)
    spec = read_image(tmp_path / "a.jpg").spec
    assert spec.get_string_attribute("DateTime") == "2020:02:18 08:56:13"
    assert spec.get_string_attribute("Exif:DateTimeOriginal") == "2020:02:18 08:56:13"


@pytest.mark.parametrize("orientation", range(1, 9))
def test_formats_without_orientation_are_turned_upright(tmp_path: Path, orientation: int) -> None:
    """OpenImageIO's own `reorient` is the reference."""
    image = source("float", orientation=orientation)
    buffer = oiio.ImageBuf(image.pixels)
    buffer.specmod().attribute("Orientation", orientation)
    expected = np.asarray(oiio.ImageBufAlgo.reorient(buffer).get_pixels(oiio.FLOAT), np.float32)
    np.testing.assert_array_equal(upright(image.pixels, orientation), expected)
    path = tmp_path / "a.ppm"
    write_image(path, image.pixels, image)
    np.testing.assert_allclose(read_image(path).pixels, expected, atol=1e-4)


def test_straight_alpha_is_not_multiplied_in(tmp_path: Path) -> None:
    image = source("uint16", channels=4)
    image.spec.attribute("oiio:UnassociatedAlpha", 1)
    path = tmp_path / "a.png"
    write_image(path, image.pixels, image)
    again = read_image(path)
    assert not is_premultiplied(again.spec)
    np.testing.assert_allclose(again.pixels, image.pixels, atol=1e-4)
    exr = tmp_path / "a.exr"
    write_image(exr, image.pixels, Image(image.pixels, oiio.ImageSpec(64, 40, 4, "float")))
    assert is_premultiplied(read_image(exr).spec)


def test_bad_input_is_one_line(tmp_path: Path) -> None:
    empty = tmp_path / "empty.jpg"
    empty.touch()
    text = tmp_path / "text.png"
    text.write_text("hello")
    for path, words in [
        (tmp_path / "none.jpg", "no such file"),
        (empty, "empty"),
        (text, "not an image|signature|PNG"),
        (tmp_path, "folder"),
        (tmp_path / ("x" * 300), "cannot be opened"),
    ]:
        with pytest.raises(ImageError, match=words) as caught:
            read_image(path)
        assert "\n" not in str(caught.value)


def test_absurd_size_is_refused_before_it_is_allocated(tmp_path: Path) -> None:
    path = tmp_path / "huge.ppm"
    path.write_bytes(b"P6\n200000 200000\n255\n" + b"\0" * 64)
    with pytest.raises(ImageError):
        read_image(path)


def test_unwritable_targets(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match=r"cannot write \"\.xyz\""):
        write_image(tmp_path / "a.xyz", ramp(), source())
    with pytest.raises(ImageError, match="alpha"):
        write_image(tmp_path / "a.jpg", ramp(channels=4), source(channels=4))
    with pytest.raises(ImageError, match="shape"):
        write_image(tmp_path / "a.tif", ramp()[..., 0], source())
    assert list(tmp_path.iterdir()) == []
