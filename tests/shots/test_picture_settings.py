"""Settings of finished pictures: gold values of real files, each maker's multipliers, pictures written before."""

from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

from lutforge.errors import ImageError
from lutforge.images.read import Image
from lutforge.images.write import write_image
from lutforge.pipeline.inspection import inspect
from lutforge.shots.maker_settings import kelvin_of, multipliers_of, white_balance_of
from lutforge.shots.metadata import read_exposure, read_picture_settings, software_tag
from lutforge.shots.tags import Tags
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES


@pytest.mark.parametrize(
    ("file", "camera", "style", "white_balance", "multipliers"),
    [
        # multipliers: the tags' levels, over 256 (Nikon 0x000c) and 8192 (Pentax 0x0201)
        ("Nikon_D90_DSC_0003.JPG", "Nikon D90", "portrait", "daylight", (461 / 256, 1, 335 / 256)),
        ("Pentax_ist_DL_IMGP6667.JPG", "Pentax *ist DL", "bright", "auto", (12736 / 8192, 1, 8000 / 8192)),
        ("Sony_A6400_DSC00007.JPG", "Sony ILCE-6400", "standard", "auto", None),
        ("Canon_PowerShot_G6_IMG_0003.JPG", "Canon PowerShot G6", "standard", "auto", None),
        ("Kodak_DC280_DCP_4394.JPG", "Kodak DC280 ZOOM DIGITAL CAMERA", "unknown", "unknown", None),
    ],
)
def test_real_pictures(
    shared_data: Path, file: str, camera: str, style: str, white_balance: str, multipliers: tuple[float, ...] | None
) -> None:
    found = read_picture_settings(shared_data / "chart_jpegs" / file)
    assert (found.camera, found.style, found.white_balance) == (camera, style, white_balance)
    if multipliers is None:
        assert found.multipliers is None
    else:
        assert found.multipliers is not None
        np.testing.assert_allclose(found.multipliers, multipliers)


def test_a_raw_file_tells_its_own(shared_data: Path) -> None:
    found = read_picture_settings(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    assert (found.camera, found.style, found.white_balance) == ("Canon PowerShot S40", "standard", "auto")
    assert found.multipliers is not None


@pytest.mark.parametrize(
    "tags",
    [
        {("Nikon", 0x000C): (512, 256, 384, 256, 256, 256, 256, 256)},
        {("Canon", 0x4001): (0,) * 63 + (2048, 1024, 1024, 1536) + (0,) * (1338 - 67)},
        {("Canon", 0x4001): (0,) * 25 + (2048, 1024, 1024, 1536) + (0,) * (582 - 29)},
        {("Pentax", 0x0201): (16384, 8192, 8192, 12288)},
        {("Olympus", 0x1017): (512, 64), ("Olympus", 0x1018): (384, 64)},
        {("OlympusIp", 0x0100): (512, 384)},
        {("Panasonic", 0x8004): (2096,), ("Panasonic", 0x8005): (1048,), ("Panasonic", 0x8006): (1572,)},
        {("Image", 0x0024): (524,), ("Image", 0x0025): (262,), ("Image", 0x0026): (393,)},
        {("Image", 0xC628): (1, 2, 1, 1, 2, 3)},
    ],
)
def test_each_maker_s_multipliers(tags: Tags) -> None:
    found = multipliers_of(tags)
    assert found is not None
    np.testing.assert_allclose(found, [2.0, 1.0, 1.5])


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {("Canon", 0x4001): (0,) * 77},
        {("Canon", 0x4001): (0,) * 1338},
        {("Canon", 0x4001): (0,) * 63 + (2048, 1024, 512, 1536) + (0,) * (1338 - 67)},
        {("Nikon", 0x000C): (512, 0, 384, 0)},
        {("Nikon", 0x000C): "text"},
        {("Pentax", 0x0201): (1, 2)},
        {("Panasonic", 0x8004): (0,), ("Panasonic", 0x8005): (262,), ("Panasonic", 0x8006): (393,)},
        {("Image", 0xC628): (0, 1, 1, 1, 1, 1)},
        {("Nikon", 0x000C): (256, 256, 256, 256, 256, 256, 256, 256)},
    ],
)
def test_what_no_camera_sets_is_not_believed(tags: Tags) -> None:
    assert multipliers_of(tags) is None


def test_a_dialled_temperature() -> None:
    assert kelvin_of({("CanonPr", 9): (5200,)}) == 5200
    assert kelvin_of({("Sony", 0xB021): (0,), ("Pentax", 0x0050): (4100,)}) == 4100
    assert kelvin_of({("Sony", 0xB021): (0xFFFFFFFF,)}) is None
    assert white_balance_of({("CanonSi", 7): (9,), ("CanonPr", 9): (3000,)}) == "3000k"
    assert white_balance_of({("CanonSi", 7): (1,), ("CanonPr", 9): (5200,)}) == "daylight"
    assert white_balance_of({("Nikon", 0x0005): "5000K"}) == "5000k"


def test_a_picture_written_before_tells_its_last_settings(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 3), 0.5, dtype=np.float32)
    for name in ("a.jpg", "a.tif", "a.png", "a.exr"):
        spec = oiio.ImageSpec(4, 4, 3, "uint8")
        spec.attribute("Make", "NIKON CORPORATION")
        spec.attribute("Model", "NIKON D40")
        spec.attribute("Software", software_tag("Canon EOS R", "fine detail/2.1,1,1.5"))
        write_image(tmp_path / name, pixels, Image(pixels, spec))
        found = read_picture_settings(tmp_path / name)
        assert (found.camera, found.style, found.white_balance) == ("Canon EOS R", "fine detail", "custom"), name
        assert found.multipliers is not None
        np.testing.assert_allclose(found.multipliers, (2.1, 1.0, 1.5))
        # Graded with some LUT after that, it has no settings any more.
        write_image(tmp_path / name, pixels, Image(pixels, spec), "graded with look.cube")
        assert read_picture_settings(tmp_path / name).style == "unknown"


def test_an_editor_is_named_and_a_stranger_is_unknown(tmp_path: Path) -> None:
    pixels = np.full((4, 4, 3), 0.5, dtype=np.float32)
    spec = oiio.ImageSpec(4, 4, 3, "uint8")
    spec.attribute("Software", "Adobe Photoshop Lightroom 6")
    write_image(tmp_path / "a.jpg", pixels, Image(pixels, spec))
    found = read_picture_settings(tmp_path / "a.jpg")
    assert (found.camera, found.style, found.white_balance) == ("", "unknown", "unknown")
    assert "Lightroom" in found.notes[0]
    (tmp_path / "b.jpg").write_bytes(b"nothing")
    with pytest.raises(ImageError):
        read_picture_settings(tmp_path / "b.jpg")


def test_an_aperture_that_the_file_does_not_state_is_told(tmp_path: Path) -> None:
    """Of the file alone f/1 stands in, and a note says so; a RAW file of the camera beside it states its own."""
    settings = CameraSettings(exposure_s=1 / 30)
    shot = photograph(nikon_d5100(), SCENES["wall"](96, 144, 1), settings, tmp_path, "shot", seed=1)
    assert shot.jpeg is not None
    whole = read_exposure(shot.jpeg)
    assert whole.aperture == 8.0 and not whole.notes
    spec = oiio.ImageSpec(8, 8, 3, "uint8")
    spec.attribute("Make", "LutForge")
    spec.attribute("Model", "Simulated D5100")
    spec.attribute("ExposureTime", 1 / 30)
    picture = tmp_path / "alone.jpg"
    write_image(picture, np.full((8, 8, 3), 0.5), Image(np.full((8, 8, 3), 0.5, np.float32), spec, "jpeg"))
    bare = read_exposure(picture)
    assert (bare.aperture, bare.iso) == (0.0, 0.0) and bare.value == pytest.approx(1 / 30, rel=1e-3)
    assert [("f/1" in note, "ISO 100" in note) for note in bare.notes] == [(True, False), (False, True)]
    assert ("exposure", "1/30 s, aperture unknown, ISO unknown") in inspect(picture).rows
    shot.dng.rename(tmp_path / "alone.dng")
    completed = read_exposure(picture)
    assert not completed.notes and completed.value == pytest.approx(whole.value, rel=1e-3)
