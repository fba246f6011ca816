"""A JPEG to a JPEG: the LUT's pixels, the source's quantization and every byte of its metadata."""

import shutil
import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image as Pillow
from PIL import ImageCms

from lutforge.colour.icc_profile import adobe_rgb_profile
from lutforge.grading.batch import apply_batch
from lutforge.grading.grade import Grade, LutRecipe
from lutforge.grading.image import apply_image
from lutforge.grading.pixels import grade_codes
from lutforge.images.exif_places import exif_places
from lutforge.images.jpeg import JpegHeader, Segment, read_header
from lutforge.images.output_spec import IN_ANOTHER_SPACE
from lutforge.images.read import read_image
from lutforge.shots.tags import SOFTWARE, tags
from tests.cases.damaged import damaged
from tests.cases.pictures import apply_to_pixels, write_cube


@pytest.fixture
def grade(tmp_path: Path) -> Grade:
    return LutRecipe(write_cube(tmp_path / "look.cube")).grade(tmp_path)


def smooth(height: int = 90, width: int = 140) -> NDArray[np.uint8]:
    y, x = np.mgrid[0:height, 0:width]
    planes = [128 + 100 * np.sin(x / 30 + c) * np.cos(y / 20 - c) for c in range(3)]
    return np.asarray(np.rint(np.stack(planes, axis=-1)), dtype=np.uint8)


def with_everything(path: Path) -> Path:
    """A JPEG with EXIF and a thumbnail, XMP, an ICC profile, a comment, and 4:2:2 chroma."""
    picture = Pillow.fromarray(smooth())
    small = BytesIO()
    picture.resize((48, 32)).save(small, "JPEG", quality=85)
    thumbnail = b"\xff\xd8" + small.getvalue()[20:]
    exif = Pillow.Exif()
    exif[0x010F], exif[0x0112] = "Maker", 6
    exif.get_ifd(0x8769)[0xA001] = 1
    exif.get_ifd(0x8769)[0x927C] = bytes(range(200))  # a note that only its maker reads
    block = exif.tobytes()[6:]
    # A second directory behind all: where the JPEG lies, and its length.
    order: Literal["little", "big"] = "little" if block[:2] == b"II" else "big"
    first = int.from_bytes(block[4:8], order)
    link = first + 2 + 12 * int.from_bytes(block[first : first + 2], order)
    at = len(block) + len(block) % 2
    start = at + 2 + 24 + 4
    entries = b"".join(
        number.to_bytes(2, order) + (4).to_bytes(2, order) + (1).to_bytes(4, order) + value.to_bytes(4, order)
        for number, value in ((0x0201, start), (0x0202, len(thumbnail)))
    )
    directory = (2).to_bytes(2, order) + entries + bytes(4)
    block = block[:link] + at.to_bytes(4, order) + block[link + 4 :].ljust(at - link - 4, b"\0") + directory + thumbnail
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    picture.save(
        path, "JPEG", quality=91, subsampling=1, exif=b"Exif\0\0" + block, icc_profile=profile, comment="by hand",
        xmp=b"<x:xmpmeta xmlns:x='adobe:ns:meta/'/>", dpi=(300, 300),
    )  # fmt: skip
    return path


def header_of(path: Path) -> JpegHeader:
    header = read_header(path.read_bytes())
    assert header is not None
    return header


def assert_metadata_kept(before: JpegHeader, after: JpegHeader) -> None:
    """Every segment is there, byte for byte, but for what leads to the thumbnail and to further pictures."""
    *segments, comment = after.segments
    assert comment.body.startswith(b"LutForge")
    kept = [segment for segment in before.segments if not segment.body.startswith(b"MPF\0")]
    assert [segment.marker for segment in segments] == [segment.marker for segment in kept]
    for first, second in zip(kept, segments, strict=True):
        place = exif_places(first.body[6:]).get("next directory") if first.body.startswith(b"Exif\0\0") else None
        if place is None:
            assert first == second
        else:
            hole = slice(place.start + 6, place.stop + 6)
            assert first.body[: hole.start] == second.body[: hole.start]
            assert first.body[hole.stop :] == second.body[hole.stop :]
            assert any(first.body[hole]) and not any(second.body[hole])


@pytest.mark.parametrize("declared_in", ["xmp", "iso"])
def test_a_gain_map_that_is_left_out_is_said(tmp_path: Path, grade: Grade, declared_in: str) -> None:
    source = with_everything(tmp_path / "a.jpg")
    plain = apply_image(grade, source, tmp_path / "plain.jpg")
    xmp = b"http://ns.adobe.com/xap/1.0/\0<x xmlns:hdrgm='http://ns.adobe.com/hdr-gain-map/1.0/'/>"
    body = Segment(0xE1, xmp) if declared_in == "xmp" else Segment(0xE2, b"urn:iso:std:iso:ts:21496:-1\0\0\0\0\0")
    data = source.read_bytes()
    source.write_bytes(data[:2] + body.stored + data[2:] + data)  # behind the picture lies another
    done = apply_image(grade, source, tmp_path / "ultra.jpg")
    told = [note for note in done.notes if "gain map (Ultra HDR)" in note]
    assert len(told) == 1 and "left out" in told[0]
    assert not [note for note in plain.notes if "gain map" in note]
    for target in ("a.png", "a.tif", "a.webp"):
        done = apply_image(grade, source, tmp_path / target)
        assert [note for note in done.notes if "gain map (Ultra HDR)" in note] == told
    assert (tmp_path / "ultra.jpg").read_bytes().count(b"\xff\xd9") < data.count(b"\xff\xd9") + 2


@pytest.mark.parametrize("whole", [True, False])
def test_metadata_tables_and_chroma_stay(tmp_path: Path, grade: Grade, whole: bool) -> None:
    source = with_everything(tmp_path / "a.jpg")
    graded = grade if whole else replace(grade, codes=None)
    done = apply_image(graded, source, tmp_path / "out" / "a.jpg")
    before, after = header_of(source), header_of(done.target)
    assert_metadata_kept(before, after)
    if whole:
        assert before.tables == after.tables
    assert before.sampling == after.sampling == ((2, 1), (1, 1), (1, 1))
    assert tags(done.target)[SOFTWARE] == "LutForge" and after.comments[-1].endswith("graded with look.cube")
    expected = apply_to_pixels(grade.processor, read_image(source).pixels)
    np.testing.assert_allclose(read_image(done.target).pixels, expected, atol=6 / 255)


def test_codes_are_those_of_floats_rounded(grade: Grade) -> None:
    codes = np.random.default_rng(0).integers(0, 256, (300, 501, 4), dtype=np.uint8)
    expected = 255 * np.clip(apply_to_pixels(grade.processor, np.divide(codes[..., :3], 255, dtype=np.float32)), 0, 1)
    assert grade.codes is not None
    grade_codes(grade.codes, codes, None)
    assert np.abs(codes[..., :3] - expected).max() <= 0.5 + 1e-3


@pytest.mark.parametrize(
    "options",
    [{"progressive": True}, {"subsampling": 0}, {"subsampling": 2}, {"keep_rgb": True}, {"quality": 30}],
    ids=str,
)
def test_other_ways_to_code(tmp_path: Path, grade: Grade, options: dict[str, object]) -> None:
    source = tmp_path / "a.jpg"
    Pillow.fromarray(smooth()).save(source, "JPEG", **{"quality": 95, **options})
    done = apply_image(grade, source, tmp_path / "b.jpg")
    expected = apply_to_pixels(grade.processor, read_image(source).pixels)
    coarse = "quality" in options
    np.testing.assert_allclose(read_image(done.target).pixels, expected, atol=(20 if coarse else 6) / 255)
    if "keep_rgb" not in options:
        assert header_of(source).tables == header_of(done.target).tables


def test_another_colour_space_is_said_in_all_places(tmp_path: Path, grade: Grade) -> None:
    source = with_everything(tmp_path / "a.jpg")
    profile = adobe_rgb_profile()
    adobe = replace(grade, attributes={"ICCProfile": profile, "Exif:ColorSpace": IN_ANOTHER_SPACE})
    apply_image(adobe, source, tmp_path / "adobe.jpg")
    after = read_image(tmp_path / "adobe.jpg").spec
    assert bytes(after.getattribute("ICCProfile")) == profile
    assert tags(tmp_path / "adobe.jpg")["Photo", 0xA001] == (0xFFFF,)
    back = replace(grade, attributes={"ICCProfile": None, "Exif:ColorSpace": 1})
    apply_image(back, tmp_path / "adobe.jpg", tmp_path / "srgb.jpg")
    assert read_image(tmp_path / "srgb.jpg").spec.getattribute("ICCProfile") is None
    assert tags(tmp_path / "srgb.jpg")["Photo", 0xA001] == (1,)


def test_headers_of_strangers_raise_nothing(tmp_path: Path) -> None:
    data, rng = with_everything(tmp_path / "a.jpg").read_bytes(), np.random.default_rng(0)
    headers = [read_header(damaged(data, rng)) for _ in range(2000)]
    places = [exif_places(header.exif) for header in headers if header is not None and header.exif is not None]
    assert None in headers  # of some no segment is found, of some no place, and others lost nothing
    assert {} in places
    assert exif_places(header_of(tmp_path / "a.jpg").exif or b"") in places


@pytest.mark.slow
def test_real_photographs_keep_their_metadata(tmp_path: Path, shared_data: Path, grade: Grade) -> None:
    sources = sorted((shared_data / "chart_jpegs").glob("*.JPG"))
    result = apply_batch(LutRecipe(tmp_path / "look.cube"), sources, tmp_path / "out")
    assert not result.failed
    for done in result.done:
        before, after = header_of(done.source), header_of(done.target)
        assert_metadata_kept(before, after)
        assert (before.tables, before.sampling) == (after.tables, after.sampling)
        assert done.target.stat().st_size < 1.25 * done.source.stat().st_size
    assert any("previews" in note for note in result.done[-1].notes)  # the Sony's
    if shutil.which("exiftool"):
        words = ["exiftool", "-a", "-G1", "-s", "-struct", "--File:all", "--System:all", "--Composite:all"]
        words += ["--MPF:all", "--MPImage1:all", "--MPImage2:all", "--IFD1:all"]
        for done in result.done:
            told = [
                subprocess.run([*words, str(path)], capture_output=True, text=True, check=True).stdout.splitlines()
                for path in (done.source, done.target)
            ]
            assert [line for line in told[0] if "MPF" not in line and "MPImage" not in line] == told[1], done.source
