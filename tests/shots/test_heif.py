"""HEIF pictures: 10 bits are read, a shot's RAW is paired with one, and a camera is calibrated from them."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rawpy
from PIL import Image

import lutforge as lf
from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.errors import ImageError
from lutforge.grading.batch import plan_jobs
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.grading.inputs import find_inputs
from lutforge.images.heif import read_heif
from lutforge.images.icc import to_srgb
from lutforge.images.read import read_image
from lutforge.pipeline.inspection import inspect
from lutforge.pipeline.sampling import file_notes, gather_samples
from lutforge.shots.discover import discover, jpeg_beside, picture_beside
from lutforge.shots.metadata import read_picture_settings
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.develop import rendered
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from tests.cases.pictures import apply_to_pixels, write_cube

heif = pytest.importorskip("pillow_heif", reason="needs the optional package pillow-heif")
CAMERA = nikon_d5100()


def write_heif(path: Path, encoded: np.ndarray, exif: bytes = b"", quality: int = 90, transfer: int = 1) -> None:
    """A 10-bit picture, its chroma at full resolution. transfer: its characteristics, of H.273."""
    pixels = np.rint(encoded * 65535).astype(np.uint16)
    picture = heif.from_bytes(mode="RGB;16", size=pixels.shape[1::-1], data=pixels.tobytes())
    codes = {"transfer_characteristics": transfer, "matrix_coefficients": 1}
    picture.save(str(path), quality=quality, chroma=444, exif=exif or None, **codes)


def pair(folder: Path, name: str, settings: CameraSettings, scene: str, seed: int) -> tuple[Path, Path]:
    """A shot's DNG, beside its JPEG, and the same in another folder beside its HEIF."""
    shot = photograph(CAMERA, SCENES[scene](448, 664, seed), settings, folder, name, seed=seed)
    other = folder / "heif"
    other.mkdir(exist_ok=True)
    with rawpy.imread(str(shot.dng)) as raw:
        picture = rendered(CAMERA, raw.raw_image_visible.copy(), settings)
    assert shot.jpeg is not None
    with Image.open(shot.jpeg) as jpeg:
        exif = jpeg.info["exif"]
    write_heif(other / f"{name}.HIF", picture, exif)
    (other / shot.dng.name).write_bytes(shot.dng.read_bytes())
    return shot.dng, other / shot.dng.name


def test_ten_bits_are_read(tmp_path: Path) -> None:
    ramp = np.broadcast_to(np.linspace(0.2, 0.3, 512)[None, :, None], (64, 512, 3))
    write_heif(tmp_path / "ramp.heic", ramp, quality=100)
    found = read_heif(tmp_path / "ramp.heic")
    assert found.bits == 10
    assert np.abs(found.codes / 65535 - ramp).max() < 2 / 1023
    assert len(np.unique(found.codes[..., 1])) > 80  # 26 in 8 bits
    assert np.abs(found.codes8 / 255 - ramp).max() < 1 / 255
    np.testing.assert_allclose(read_image(tmp_path / "ramp.heic").pixels, ramp, atol=2 / 1023)


def test_metadata_that_are_no_text_are_read_as_question_marks(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[306] = "2021:04:05 14:51:20"
    write_heif(tmp_path / "a.heic", np.full((64, 64, 3), 0.5), exif.tobytes().replace(b"2021:", b"20\xff\xff:"))
    assert read_image(tmp_path / "a.heic").spec.get_string_attribute("DateTime") == "20??:04:05 14:51:20"


def test_what_is_none_is_said_in_a_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    broken = tmp_path / "broken.heic"
    for data in (b"", b"no picture", b"\0\0\0\x18ftypheic" + bytes(100)):
        broken.write_bytes(data)
        with pytest.raises(ImageError, match=r"broken\.heic"):
            read_heif(broken)
    write_heif(broken, np.full((64, 64, 3), 0.5))
    whole = broken.read_bytes()
    broken.write_bytes(whole[: len(whole) * 2 // 3])
    with pytest.raises(ImageError, match=r"broken\.heic"):
        read_heif(broken)
    broken.write_bytes(whole)
    monkeypatch.setitem(sys.modules, "pillow_heif", None)
    with pytest.raises(ImageError, match=r"lutforge\[heif\]"):
        read_heif(broken)


@pytest.mark.parametrize(("transfer", "name"), [(16, "PQ"), pytest.param(18, "HLG", marks=pytest.mark.slow)])
def test_a_picture_for_hdr_displays_is_passed_over_and_said_once(tmp_path: Path, transfer: int, name: str) -> None:
    _, dng = pair(tmp_path, "shot", CameraSettings(exposure_s=1 / 30), "still-life", 1)
    write_heif(dng.with_suffix(".HIF"), np.full((440, 648, 3), 0.5), transfer=transfer)
    notes = [note for note in file_notes(gather_samples([dng]).shots) if "HDR" in note]
    assert len(notes) == 1 and f"passed over: {dng.with_suffix('.HIF')}: its colours are in {name}" in notes[0]


@pytest.mark.parametrize(
    ("codes", "stated"), [({"transfer_characteristics": 16}, "PQ"), ({"color_primaries": 12}, "Display P3"), ({}, "")]
)
def test_a_picture_that_states_other_colours_than_srgb_is_not_graded_as_srgb(
    tmp_path: Path, codes: dict[str, int], stated: str
) -> None:
    picture = heif.from_pillow(Image.new("RGB", (64, 64), "green"))
    picture.save(str(tmp_path / "a.heic"), **codes)
    grade = replace(LutRecipe(write_cube(tmp_path / "look.cube")).grade(tmp_path / "a.heic"), for_srgb=True)
    if not stated:
        apply_image(grade, tmp_path / "a.heic", tmp_path / "b.png")
        return
    with pytest.raises(ImageError, match=stated):
        apply_image(grade, tmp_path / "a.heic", tmp_path / "b.png")


def test_a_jpeg_comes_before_a_heif_of_the_same_stem(tmp_path: Path) -> None:
    for name in ("A[1].HIF", "A[1].jpg", "b.HIF"):
        (tmp_path / name).touch()
    both, alone = tmp_path / "a[1].nef", tmp_path / "b.nef"
    assert jpeg_beside(both) == picture_beside(both) == tmp_path / "A[1].jpg"
    assert jpeg_beside(alone) is None and picture_beside(alone) == tmp_path / "b.HIF"


def test_a_shot_is_paired_with_its_heif(tmp_path: Path) -> None:
    settings = CameraSettings(style="vivid", white_balance="tungsten", exposure_s=1 / 30)
    _, dng = pair(tmp_path, "shot", settings, "still-life", 1)
    picture = dng.with_suffix(".HIF")
    assert picture_beside(dng) == picture
    assert discover([dng, picture]) == [dng]
    shot = read_shot(dng)
    assert shot.jpeg_source == str(picture) and shot.fine is not None
    assert np.abs(shot.fine / 257 - shot.jpeg).max() <= 0.5
    assert shot.metadata.style == "vivid" and shot.metadata.white_balance == "tungsten"
    picture_settings = read_picture_settings(picture)
    assert picture_settings.camera == CAMERA.name
    assert picture_settings.exposure == pytest.approx(read_picture_settings(tmp_path / "shot.JPG").exposure)
    assert ("picture", "648 × 440, heif, 10 bits") in inspect(picture).rows
    assert picture in find_inputs([picture.parent], tmp_path / "out")[0]


@pytest.mark.parametrize(("bits", "suffix", "depth"), [(8, ".jpg", "uint8"), (10, ".tif", "uint16")])
def test_a_heif_is_graded(tmp_path: Path, bits: int, suffix: str, depth: str) -> None:
    """Eight bits in a wide space become a JPEG in sRGB; ten bits keep them in a TIFF."""
    colours, exif = np.linspace(0.2, 0.8, 64 * 96 * 3).reshape(64, 96, 3), Image.Exif()
    exif[0x0110] = "A phone"
    exif.get_ifd(0x8769)[0xA001] = 0xFFFF
    source = tmp_path / "a.heic"
    if bits == 8:
        codes = np.rint(colours * 255).astype(np.uint8)
        wide = heif.from_pillow(Image.fromarray(codes))
        wide.save(str(source), quality=100, chroma=444, exif=exif.tobytes(), icc_profile=adobe_rgb_profile())
        expected = to_srgb(read_heif(source).codes8, adobe_rgb_profile()) / 255
    else:
        write_heif(source, colours, exif.tobytes(), quality=100)
        expected = read_image(source).pixels.astype(np.float64)
    grade = replace(LutRecipe(write_cube(tmp_path / "look.cube")).grade(source), for_srgb=True)
    (job,) = plan_jobs([source], tmp_path, None if bits == 8 else suffix)
    assert job.target == tmp_path / f"a{suffix}"
    result = apply_image(grade, source, job.target)
    graded = read_image(job.target)
    assert str(graded.spec.format) == depth and graded.spec.get_string_attribute("Model") == "A phone"
    straight = apply_to_pixels(grade.processor, expected.astype(np.float32))
    assert np.abs(graded.pixels - straight).mean() < (1 / 255 if bits == 8 else 1 / 65535)
    if bits == 8:
        assert any("converted to sRGB" in note for note in result.notes)
        assert graded.spec.getattribute("ICCProfile") is None
        assert graded.spec.get_int_attribute("Exif:ColorSpace") == 1


@pytest.mark.slow
def test_calibrating_from_heif_is_no_worse_than_from_jpeg(tmp_path: Path) -> None:
    raws, heifs = [], []
    for index, (scene, exposure) in enumerate((("chart", 1.0), ("wall", 1.2), ("wall", 0.4), ("still-life", 0.8))):
        settings = CameraSettings(style="standard", white_balance="daylight", exposure_s=exposure / 60)
        raw, other = pair(tmp_path, f"s{index}", settings, scene, index)
        raws.append(raw)
        heifs.append(other)
    errors = {}
    for kind, files in (("jpeg", raws), ("heif", heifs)):
        profile = lf.calibrate(files)
        errors[kind] = profile.styles["standard"].errors
    for direction in ("render_mean", "linearize_mean"):
        assert errors["heif"][direction] <= errors["jpeg"][direction]
