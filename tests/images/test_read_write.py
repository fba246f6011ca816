"""Images through OpenImageIO: what a file says about itself survives, and bad files give one clear line."""

import math
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
import rawpy
from numpy.typing import NDArray
from PIL import ImageCms

from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.errors import ImageError
from lutforge.images.orientation import upright
from lutforge.images.raw import read_raw
from lutforge.images.read import Image, is_premultiplied, read_image
from lutforge.images.saturation import saturation_spike
from lutforge.images.tiff_writer import TiffWriter, byte_field, long_field, rational_field, short_field, text_field
from lutforge.images.write import write_image
from lutforge.simulate.dng import write_dng

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


# --- RAW files: scale, saturation, and what is refused ----------------------------------------------------------------


@pytest.fixture
def mosaic() -> np.ndarray[tuple[int, int], np.dtype[np.uint16]]:
    """RGGB, black 64, white 4095: red 1000, greens 2000 and 2010, blue 3000; a saturated corner."""
    pixels = np.empty((80, 120), dtype=np.uint16)
    pixels[0::2, 0::2], pixels[0::2, 1::2], pixels[1::2, 0::2], pixels[1::2, 1::2] = 1000, 2000, 2010, 3000
    pixels[:20, :20] = 4095
    return pixels


def test_black_is_zero_and_saturation_one(tmp_path: Path, mosaic: np.ndarray) -> None:
    path = tmp_path / "flat.dng"
    write_dng(path, mosaic, black=64, white=4095, as_shot_neutral=(0.5, 1, 0.8), exposure_s=1 / 50, iso=400)
    raw = read_raw(path, half_size=True)
    assert raw.pixels.shape == (40, 60, 3)
    assert raw.pixels.dtype == np.float32
    assert raw.pixel_size == 2
    expected = [(1000 - 64) / 4031, (2005 - 64) / 4031, (3000 - 64) / 4031]
    np.testing.assert_allclose(raw.pixels[20, 30], expected, atol=2e-4)
    np.testing.assert_array_equal(raw.pixels[:10, :10], 1)
    assert raw.multipliers is not None
    np.testing.assert_allclose(raw.multipliers, [2, 1, 1.25], rtol=1e-3)
    assert raw.exposure_s == pytest.approx(1 / 50)
    assert raw.iso == 400
    full = read_raw(path)
    assert full.pixels.shape == (80, 120, 3)
    assert full.pixel_size == 1
    np.testing.assert_allclose(full.pixels[40, 60], expected, atol=3e-3)


def test_a_dng_states_what_makes_light_d65_neutral(tmp_path: Path, mosaic: np.ndarray) -> None:
    """By its ColorMatrix, whether or not LibRaw knows the camera (DNG 1.4, "Mapping Camera Color Space to CIE XYZ")."""
    neutral = np.array([0.5, 1.0, 0.7])
    balanced = np.array([[1.1, -0.1, 0.0], [-0.3, 1.2, 0.1], [0.0, 0.1, 0.9]]) @ np.linalg.inv(SRGB_TO_XYZ)
    path, white = tmp_path / "phone.dng", SRGB_TO_XYZ.sum(axis=1)
    write_dng(path, mosaic, black=64, white=4095, color_matrix=balanced * (neutral / (balanced @ white))[:, None])
    d65 = read_raw(path, half_size=True).d65
    assert d65 is not None
    np.testing.assert_allclose(d65, 1 / neutral, rtol=1e-3)


@pytest.mark.parametrize(
    ("blacks", "expected"),
    [((160, 160, 160), (160, 160, 160)), ((160, 200, 240), (160, 200, 240)), ((60, 64, 68, 80), (60, 66, 80))],
    ids=["linear", "linear, by channel", "mosaic, by place"],
)
def test_each_black_level_of_a_dng_is_zero(tmp_path: Path, blacks: tuple[int, ...], expected: tuple[int, ...]) -> None:
    """DNG 1.4, BlackLevel: of each channel where there is no mosaic, of each place of a 2 × 2 pattern."""
    codes, white, black = np.array([1000, 2000, 3000]), 4095, np.array(expected)
    mosaicked = len(blacks) == 4
    pixels = np.tile(codes.astype("<u2"), (80, 120, 1))
    pixels[:20, :20] = white
    if mosaicked:
        rows, columns = np.indices((80, 120)) % 2
        pixels = np.take_along_axis(pixels, (rows + columns)[..., None], axis=2)
    tiff, count = TiffWriter(), 1 if mosaicked else 3
    fields = {254: long_field(0), 256: long_field(120), 257: long_field(80), 258: short_field(*[16] * count)}
    fields |= {259: short_field(1), 262: short_field(32803 if mosaicked else 34892), 271: text_field("LutForge")}
    fields |= {272: text_field("Linear"), 273: long_field(tiff.append(pixels.tobytes())), 277: short_field(count)}
    fields |= {278: long_field(80), 279: long_field(pixels.nbytes), 284: short_field(1), 50706: byte_field(1, 4, 0, 0)}
    if mosaicked:
        fields |= {33421: short_field(2, 2), 33422: byte_field(0, 1, 1, 2), 50713: short_field(2, 2)}
    fields |= {
        50714: short_field(*blacks),
        50717: short_field(*[white] * count),
        50728: rational_field([0.5, 1.0, 0.8]),
    }
    fields |= {50721: rational_field(np.linalg.inv(SRGB_TO_XYZ).ravel(), signed=True), 50778: short_field(21)}
    (tmp_path / "a.dng").write_bytes(tiff.finish(tiff.directory(fields)))
    raw = read_raw(tmp_path / "a.dng", half_size=True)
    np.testing.assert_allclose(raw.pixels[-5, -5], (codes - black) / (white - black), atol=1e-4)
    assert np.all(raw.pixels[:9, :9] == 1)


def test_black_level_and_scale_against_the_mosaic_itself(shared_data: Path) -> None:
    path = shared_data / "canon_powershot_s40" / "CRW_0112.CRW"
    with rawpy.imread(str(path)) as opened:
        mosaic = opened.raw_image_visible.astype(np.float64)
        white, black = opened.white_level, opened.black_level_per_channel[0]
    red = np.clip((mosaic[0::2, 0::2] - black) / (white - black), 0, 1)
    # Red is the upper left of each block: three quarters of it and a quarter of the next make the block's centre.
    below = 0.75 * red[:-1] + 0.25 * red[1:]
    centre = 0.75 * below[:, :-1] + 0.25 * below[:, 1:]
    raw = read_raw(path, half_size=True)
    inside = raw.pixels[:-1, :-1, 0]
    unclipped = red[:-1, :-1] < 1
    np.testing.assert_allclose(inside[unclipped], centre[unclipped], atol=1e-4)
    assert np.all(inside[~unclipped] == 1)
    assert (raw.pixels[..., 1] == 1).any()


def test_equal_multipliers_mean_unknown(tmp_path: Path, mosaic: np.ndarray) -> None:
    path = tmp_path / "unknown.dng"
    write_dng(path, mosaic, black=64, white=4095, as_shot_neutral=(1, 1, 1))
    assert read_raw(path, half_size=True).multipliers is None


def test_clipping_below_the_nominal_white_is_saturation() -> None:
    rng = np.random.default_rng(0)
    signal = np.minimum(rng.uniform(0, 1.3, 100_000) * 3800, 3800 + rng.normal(0, 2, 100_000))
    histogram = np.bincount(signal.astype(int), minlength=4096)
    assert saturation_spike(histogram, 4095) == pytest.approx(3800 / 4095, abs=0.006)
    lower = np.bincount(np.minimum(signal, 3000).astype(int))
    assert saturation_spike(lower, 4095) == pytest.approx(3000 / 4095, abs=0.006)
    assert saturation_spike(np.bincount(rng.uniform(0, 3900, 100_000).astype(int)), 4095) == 1


def test_a_bright_even_surface_is_not_clipping() -> None:
    photons = np.random.default_rng(0).normal(3300, 3300 * 0.01, 200_000)
    assert saturation_spike(np.bincount(photons.astype(int)), 4095) == 1


@pytest.mark.parametrize(
    ("content", "why"),
    [(b"", "the file is empty"), (b"just text\n" * 50, "not a RAW file"), (b"II*\0\x08\0\0\0" * 9, "RAW file")],
)
def test_illegal_files(tmp_path: Path, content: bytes, why: str) -> None:
    path = tmp_path / "photo.CR2"
    path.write_bytes(content)
    with pytest.raises(ImageError, match=why) as caught:
        read_raw(path)
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize("share", [0.02, 0.3, 0.9])
def test_truncated_files_are_refused(shared_data: Path, tmp_path: Path, share: float) -> None:
    whole = (shared_data / "unusual_raw" / "Nikon_D1_RAW_NIKON_D1.NEF").read_bytes()
    path = tmp_path / "cut.NEF"
    path.write_bytes(whole[: math.floor(share * len(whole))])
    with pytest.raises(ImageError, match=r"cut\.NEF"):
        read_raw(path, half_size=True)


def test_clipping_of_a_real_file_below_the_nominal_white(shared_data: Path) -> None:
    # All channels of this EOS D30 pile up at codes 3790–3840, black 128, while LibRaw's white is 4095.
    raw = read_raw(shared_data / "canon_eos_d30" / "Canon_D30_imagemeta_CRW.CRW", half_size=True)
    np.testing.assert_allclose(raw.clip_level, (3790 - 128) / (4095 - 128), atol=0.004)
    assert ((raw.pixels == 1).mean(axis=(0, 1)) > 0.005).all()
