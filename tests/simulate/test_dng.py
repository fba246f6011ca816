"""The DNG writer, against two independent readers: LibRaw (rawpy) and ExifRead."""

from pathlib import Path

import exifread
import numpy as np
import pytest
import rawpy
from numpy.typing import NDArray

from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.dng import write_dng
from lutforge.simulate.photograph import write_jpeg


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
