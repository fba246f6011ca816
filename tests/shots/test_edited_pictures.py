"""The settings of finished pictures that programs wrote."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PIL.Image
import pytest

from lutforge.calibration.calibrate import assembled
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.errors import ImageError
from lutforge.images.raw import read_raw
from lutforge.images.read import Image
from lutforge.images.write import write_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.inspection import inspect
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.shots.maker_settings import edited_notes
from lutforge.shots.metadata import read_metadata, read_picture_settings, software_tag
from lutforge.shots.tags import tags
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.dng import write_dng
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from tests.cases.profiles import small_profile
from tests.cases.samples import made_samples


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


PHOTOSHOP = b'xmp:CreatorTool="Adobe Photoshop 25.0 (Windows)"'


@pytest.mark.parametrize(
    "stated",
    [
        PHOTOSHOP,
        b"xmp:CreatorTool = 'Adobe Photoshop Lightroom Classic 13.0 (Macintosh)'",
        b'xap:CreatorTool="Adobe Photoshop CS Windows"',
        b'tiff:Software="Adobe Photoshop CS6"',
        b"><xmp:CreatorTool>\nCapture One 23 Macintosh</xmp:CreatorTool>",
        b"><stEvt:softwareAgent>Adobe Lightroom 7.1</stEvt:softwareAgent>",
        b'photoshop:ColorMode="3"',
        b"><photoshop:History>opened</photoshop:History>",
        b'crs:Version="15.0" crs:AlreadyApplied="True"',
        b'darktable:history_end="11"',
        b'GIMP:Platform="Linux"',
        *(f'xmp:CreatorTool="{name}"'.encode() for name in ("Snapseed 2.0", "VSCO", "PicsArt", "Photos 8.0", "Picasa")),
    ],
)
def test_xmp_alone_names_the_editor(tmp_path: Path, stated: bytes) -> None:
    PIL.Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg", xmp=b"<rdf:Description " + stated + b"/>")
    (note,) = edited_notes(tags(tmp_path / "a.jpg"))
    assert "wrote this file" in note
    PIL.Image.new("RGB", (8, 8)).save(tmp_path / "a.webp", xmp=b"<rdf:Description " + stated + b"/>")
    assert edited_notes(tags(tmp_path / "a.webp")) == (note,)


@pytest.mark.parametrize(
    "stated",
    [
        b'xmp:CreatorTool="NIKON D750 Ver.1.10"',
        b'xmp:CreatorTool="17.1.1" photoshop:DateCreated="2024-01-01"',  # of an iPhone
        b'xmp:CreatorTool="HDR+ 1.0.585804376zd"',
        b'photoshop:Credit="A. N." photoshop:City="Rome"',  # which cameras write for the press
        b'crs:Version="7.0" crs:HasSettings="False" crs:AlreadyApplied="False"',  # of a drone
        b'xmp:Rating="3"',
    ],
)
def test_xmp_of_a_camera_names_no_editor(tmp_path: Path, stated: bytes) -> None:
    PIL.Image.new("RGB", (8, 8)).save(tmp_path / "a.jpg", xmp=b"<rdf:Description " + stated + b"/>")
    assert not edited_notes(tags(tmp_path / "a.jpg"))


def test_xmp_of_heif_names_the_editor(tmp_path: Path) -> None:
    heif = pytest.importorskip("pillow_heif", reason="needs pillow-heif")
    xmp = b"<rdf:Description " + PHOTOSHOP + b"/>"
    heif.from_pillow(PIL.Image.new("RGB", (64, 64))).save(str(tmp_path / "a.heic"), xmp=xmp)
    assert any("Photoshop 25.0" in note for note in read_picture_settings(tmp_path / "a.heic").notes)


def test_an_aperture_that_the_file_does_not_state_is_told(tmp_path: Path) -> None:
    """Of the file alone f/1 stands in, and a note says so; a RAW file of the camera beside it states its own."""
    settings = CameraSettings(exposure_s=1 / 30)
    shot = photograph(nikon_d5100(), SCENES["wall"](96, 144, 1), settings, tmp_path, "shot", seed=1)
    assert shot.jpeg is not None
    whole = read_picture_settings(shot.jpeg)
    assert whole.aperture == 8.0 and not whole.exposure_notes
    spec = oiio.ImageSpec(8, 8, 3, "uint8")
    spec.attribute("Make", "LutForge")
    spec.attribute("Model", "Simulated D5100")
    spec.attribute("ExposureTime", 1 / 30)
    picture = tmp_path / "alone.jpg"
    write_image(picture, np.full((8, 8, 3), 0.5), Image(np.full((8, 8, 3), 0.5, np.float32), spec, "jpeg"))
    bare = read_picture_settings(picture)
    assert np.isnan([bare.aperture, bare.iso]).all() and bare.exposure == pytest.approx(1 / 30, rel=1e-3)
    assert [("f/1" in note, "ISO 100" in note) for note in bare.exposure_notes] == [(True, False), (False, True)]
    assert ("exposure", "1/30 s, aperture unknown, ISO unknown") in inspect(picture).rows
    shot.dng.rename(tmp_path / "alone.dng")
    completed = read_picture_settings(picture)
    assert not completed.exposure_notes and completed.exposure == pytest.approx(whole.exposure, rel=1e-3)


def test_a_dngs_own_name_of_the_camera_goes_into_the_profile(tmp_path: Path) -> None:
    mosaic = np.full((64, 64), 500, dtype=np.uint16)
    write_dng(tmp_path / "a.dng", mosaic, make="Leica Camera AG", model="LEICA Q2")
    metadata = read_metadata(tmp_path / "a.dng", read_raw(tmp_path / "a.dng"), None)
    assert (metadata.camera, metadata.dng_camera) == ("Leica Q2", "Leica Camera AG LEICA Q2")
    samples = replace(made_samples(), dng_camera=np.resize(["", metadata.dng_camera], len(made_samples())))
    samples.save(tmp_path / "samples.csv")
    assert _profile_of(read_samples(tmp_path / "samples.csv")).dng_camera == metadata.dng_camera
    assert _profile_of(replace(samples, dng_camera=np.resize(["Q2", "Q3"], len(samples)))).dng_camera == ""


def _profile_of(samples: SampleSet) -> CameraProfile:
    """A profile as a calibration assembles it from samples, with the styles of another."""
    state = CalibrationState(samples, samples.wb, beta=0.3, curves=15)
    return assembled(state, np.eye(3), small_profile().styles, {})
