"""A shot from its files: which JPEG is taken, what is said where none will do, and what the tags mean."""

import struct
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.errors import ImageError, ShotError
from lutforge.images.read import read_image
from lutforge.images.write import write_image
from lutforge.pipeline.sampling import file_notes, gather_samples
from lutforge.shots.discover import discover
from lutforge.shots.read import EMBEDDED, read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.dng import write_dng
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import paint_wall, still_life
from tests.conftest import CommandLine


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three shots: pair.dng with its JPEG, alone.dng with a preview only, wrong.dng beside another's JPEG."""
    folder = tmp_path_factory.mktemp("shots")
    camera, scene = nikon_d5100(), still_life(448, 664, seed=1)
    settings = CameraSettings(style="vivid", white_balance="tungsten", exposure_s=1 / 30)
    photograph(camera, scene, settings, folder, "pair")
    photograph(camera, scene, settings, folder, "alone", jpeg_beside=False)
    photograph(camera, scene, settings, folder, "wrong", jpeg_beside=False)
    other = photograph(camera, paint_wall(448, 664, seed=5), settings, folder, "other")
    assert other.jpeg is not None
    other.jpeg.rename(folder / "wrong.jpeg")
    other.dng.unlink()
    return folder


def test_prefers_the_jpeg_beside(folder: Path) -> None:
    shot = read_shot(folder / "pair.dng")
    assert shot.name == "pair"
    assert shot.jpeg_source == str(folder / "pair.JPG")
    assert shot.registration.scale == pytest.approx(1.0, abs=1e-3)
    assert (shot.registration.offset_x, shot.registration.offset_y) == pytest.approx((8.0, 4.0), abs=0.15)
    embedded = read_shot(folder / "alone.dng")
    assert embedded.jpeg_source == EMBEDDED
    assert embedded.registration.scale == pytest.approx(2.0, abs=3e-3)
    assert embedded.registration.offset_x == pytest.approx(shot.registration.offset_x, abs=0.5)
    assert embedded.registration.offset_y == pytest.approx(shot.registration.offset_y, abs=0.5)


def test_settings_of_a_dng(folder: Path) -> None:
    settings = read_shot(folder / "alone.dng").metadata
    assert settings.style == "vivid"
    assert settings.white_balance == "tungsten"
    assert settings.exposure_s == pytest.approx(1 / 30, rel=1e-5)
    assert settings.iso == 100
    assert settings.multipliers is not None
    np.testing.assert_allclose(settings.multipliers, nikon_d5100().multipliers("tungsten"), rtol=1e-4)


def test_passes_over_a_jpeg_of_another_scene(folder: Path) -> None:
    shot = read_shot(folder / "wrong.dng")
    assert shot.jpeg_source == EMBEDDED
    assert any("wrong.jpeg" in note and "does not match" in note for note in shot.metadata.notes)
    notes = file_notes(gather_samples([folder / "wrong.dng"]).shots)
    assert any(note.startswith("wrong: passed over: ") and "does not match" in note for note in notes)


@pytest.mark.slow
def test_commands_tell_a_note_once_for_all_that_share_it(folder: Path, tmp_path: Path, lutforge: CommandLine) -> None:
    for name in ("one", "two"):
        for kind in ("dng", "jpeg"):
            (tmp_path / f"{name}.{kind}").write_bytes((folder / f"wrong.{kind}").read_bytes())
    for words in (("sample", "-o", "s.csv"), ("calibrate", "-o", "c.npz", "--size", "3")):
        run = lutforge(*words, "one.dng", "two.dng", cwd=tmp_path)
        output = [line for line in run.stderr.splitlines() if "passed over" in line]
        assert len(output) == 1 and output[0].startswith("note: 2 shots, such as one") and "does not match" in output[0]


def test_prefers_the_jpeg_that_no_program_has_touched(folder: Path, tmp_path: Path) -> None:
    for name in ("pair.dng", "pair.JPG"):
        (tmp_path / name).write_bytes((folder / name).read_bytes())
    jpeg = read_image(tmp_path / "pair.JPG")
    jpeg.spec.attribute("Software", "Adobe Photoshop 21.0")
    write_image(tmp_path / "pair.JPG", jpeg.pixels, jpeg)
    shot = read_shot(tmp_path / "pair.dng")
    assert shot.jpeg_source == EMBEDDED
    assert any("pair.JPG: Adobe Photoshop 21.0 wrote this file" in note for note in shot.metadata.notes)


@pytest.mark.parametrize("xmp", [b'xmp:CreatorTool="Adobe Photoshop 25.0"', b'crs:AlreadyApplied="True"'])
def test_prefers_it_where_only_xmp_names_the_program(folder: Path, tmp_path: Path, xmp: bytes) -> None:
    """The EXIF is still the camera's own, its Software tag too."""
    (tmp_path / "pair.dng").write_bytes((folder / "pair.dng").read_bytes())
    packet = b"http://ns.adobe.com/xap/1.0/\0<rdf:Description " + xmp + b"/>"
    data = (folder / "pair.JPG").read_bytes()
    segment = b"\xff\xe1" + (len(packet) + 2).to_bytes(2, "big") + packet
    (tmp_path / "pair.JPG").write_bytes(data[:2] + segment + data[2:])
    shot = read_shot(tmp_path / "pair.dng")
    assert shot.jpeg_source == EMBEDDED
    assert any("pair.JPG" in note and "wrote this file" in note for note in shot.metadata.notes)


def test_says_that_a_converters_dng_holds_the_converters_rendering(folder: Path, tmp_path: Path) -> None:
    data = (folder / "alone.dng").read_bytes()
    firmware = b"LutForge simulated camera"
    assert firmware in data
    data = data.replace(firmware, b"Adobe DNG Converter 9.0".ljust(len(firmware), b"\0"))
    (tmp_path / "a.dng").write_bytes(data)
    assert any("Adobe DNG Converter" in note for note in read_shot(tmp_path / "a.dng").metadata.notes)
    assert not any("wrote this file" in note for note in read_shot(folder / "alone.dng").metadata.notes)


def test_a_frame_without_a_jpeg_is_told_where_to_put_one(tmp_path: Path) -> None:
    """Such as a frame of CinemaDNG."""
    mosaic = np.full((80, 120), 900, dtype=np.uint16)
    write_dng(tmp_path / "a.dng", mosaic, black=64, white=4095, as_shot_neutral=(0.5, 1, 0.8), exposure_s=0.02, iso=400)
    with pytest.raises(ShotError, match="no embedded preview; put the JPEG that the camera made beside it"):
        read_shot(tmp_path / "a.dng")


def test_discover(folder: Path, tmp_path: Path) -> None:
    raws = [folder / name for name in ("alone.dng", "pair.dng", "wrong.dng")]
    assert discover([folder]) == raws
    assert discover([folder / "pair.dng", folder / "pair.JPG", folder]) == [raws[1], raws[0], raws[2]]
    assert discover([folder / "pair.dng", str(folder / "." / "pair.dng")]) == [raws[1]]
    with pytest.raises(ShotError, match="no such file"):
        discover([folder / "nothing.CR2"])
    with pytest.raises(ShotError, match="holds no RAW files"):
        discover([tmp_path])


@pytest.mark.parametrize(
    ("file", "why"),
    [
        ("Canon_G1_bayer4.crw", "a mosaic of 4 colours"),
        ("DC0008L.KDC", "only a 96×64 bitmap thumbnail"),
        ("Nikon_D1_RAW_NIKON_D1.NEF", "only a 160×120 bitmap thumbnail"),
    ],
)
def test_unusual_raw_is_refused(shared_data: Path, file: str, why: str) -> None:
    with pytest.raises((ShotError, ImageError), match=why):
        read_shot(shared_data / "unusual_raw" / file)


def test_a_jpeg_alone_is_no_shot(shared_data: Path) -> None:
    with pytest.raises(ShotError, match="a JPEG by itself is not a shot"):
        read_shot(shared_data / "canon_powershot_s40" / "IMG_0102.JPG")


WIDE = {
    "Display P3": ((0.51512, 0.24119, -0.00105), (0.29198, 0.69225, 0.04189), (0.15710, 0.06657, 0.78407)),
    "Rec. 2020": ((0.67346, 0.27904, -0.00193), (0.16566, 0.67534, 0.02997), (0.12505, 0.04561, 0.79686)),
}
"""XYZ of red, green and blue, adapted to D50, as ICC profiles of these spaces have them."""


def wide_profile(name: str) -> bytes:
    """An ICC profile with the primaries of a space, and the curve of Adobe RGB."""
    profile = adobe_rgb_profile()
    adobe = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
    for old, new in zip(adobe, WIDE[name], strict=True):
        before, after = (struct.pack(">3i", *(round(65536 * value) for value in xyz)) for xyz in (old, new))
        assert profile.count(before) == 1
        profile = profile.replace(before, after)
    return profile


@pytest.mark.parametrize("name", WIDE)
def test_pictures_in_wide_spaces_are_converted_by_their_profiles(folder: Path, tmp_path: Path, name: str) -> None:
    own = read_shot(folder / "pair.dng")
    (tmp_path / "pair.dng").write_bytes((folder / "pair.dng").read_bytes())
    profile = wide_profile(name)
    with Image.open(folder / "pair.JPG") as picture:
        exif = picture.info["exif"]
        there = ImageCms.profileToProfile(
            picture, ImageCms.createProfile("sRGB"), ImageCms.ImageCmsProfile(BytesIO(profile))
        )
    assert there is not None
    there.save(tmp_path / "pair.JPG", quality=98, subsampling=0, exif=exif, icc_profile=profile)
    shot = read_shot(tmp_path / "pair.dng")
    assert any("converted to sRGB" in note for note in shot.metadata.notes)
    assert not any("converted to sRGB" in note for note in own.metadata.notes)
    assert shot.metadata.style == own.metadata.style == "vivid"
    inside = np.all((own.jpeg > 12) & (own.jpeg < 243), axis=-1)
    stored = np.asarray(there, dtype=np.float64)
    difference = np.abs(shot.jpeg.astype(np.float64) - own.jpeg)[inside]
    assert difference.mean() < 1.5
    assert np.abs(stored - own.jpeg)[inside].mean() > 3 * difference.mean()  # they do differ
