"""RAW files: scale, saturation, and which are refused."""

import math
import struct
from pathlib import Path

import numpy as np
import pytest
import rawpy

from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.errors import ImageError, ShotError
from lutforge.images.raw import read_raw
from lutforge.images.saturation import saturation_spike
from lutforge.images.tiff_writer import TiffWriter, byte_field, long_field, rational_field, short_field, text_field
from lutforge.shots.discover import discover
from lutforge.shots.read import read_shot
from lutforge.simulate.dng import write_dng


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


VC_5, JPEG_XL, UNKNOWN = 9, 52546, 12345
"""Compressions in a DNG file: a GoPro's, that of DNG 1.7, and one that may come."""


@pytest.mark.parametrize("compression", [VC_5, JPEG_XL, UNKNOWN])
@pytest.mark.parametrize("suffix", [".gpr", ".GPR", ".dng"])
def test_a_compression_that_libraw_does_not_know_names_the_converter(
    tmp_path: Path, mosaic: np.ndarray, compression: int, suffix: str
) -> None:
    path = tmp_path / f"a{suffix}"
    write_dng(path, mosaic, black=64, white=4095, as_shot_neutral=(0.5, 1, 0.8), exposure_s=1 / 50, iso=400)
    uncompressed = struct.pack("<HHII", 259, 3, 1, 1)
    data = path.read_bytes()
    assert data.count(uncompressed) == 1
    path.write_bytes(data.replace(uncompressed, struct.pack("<HHII", 259, 3, 1, compression)))
    for read in (read_raw, read_shot):
        with pytest.raises(ImageError, match="convert it with Adobe DNG Converter"):
            read(path)


@pytest.mark.parametrize("name", ["a.braw", "A001.R3D", "a.crm", "a.mxf"])
def test_films_are_told_how_to_get_frames(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"\0\0\0\x08wide" + bytes(5000))
    with pytest.raises(ImageError, match="export frames of the film as TIFF or EXR"):
        read_shot(tmp_path / name)
    if name != "A001.R3D":  # which a folder is searched for
        with pytest.raises(ShotError, match=f"films, such as {name}: export frames"):
            discover([tmp_path])


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
