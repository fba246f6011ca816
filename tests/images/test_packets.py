"""Metadata of a picture: in every format that `apply` writes, each kind is there or named as lost."""

import json
import shutil
import struct
import subprocess
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.packets import declares_film, read_packets, without_further_pictures
from lutforge.shots.maker_settings import edited_notes
from lutforge.shots.tags import tags
from tests.cases.pictures import write_cube

TAGS: dict[str, tuple[str, ...]] = {
    "EXIF": ("-ExifIFD:FocalLength=35",),
    "GPS": ("-GPS:GPSLatitude=52.5", "-GPS:GPSLatitudeRef=N"),
    "XMP": ("-XMP:Rating=4", "-XMP-dc:Subject=sea", "-XMP-dc:Description=a shore"),
    "IPTC": ("-IPTC:City=Berlin",),
}
SAYS: dict[str, dict[str, object]] = {
    "EXIF": {"FocalLength": 35},
    "GPS": {"GPSLatitude": 52.5},
    "XMP": {"Rating": 4, "Subject": "sea", "Description": "a shore"},
    "IPTC": {"City": "Berlin"},
}
GROUPS = {"EXIF": "EXIF", "GPS": "EXIF", "XMP": "XMP", "IPTC": "IPTC"}
needs_exiftool = pytest.mark.skipif(shutil.which("exiftool") is None, reason="needs exiftool")


def picture(path: Path) -> Path:
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    pixels = np.random.default_rng(0).integers(0, 256, (33, 49, 3), dtype=np.uint8)
    if path.suffix == ".webp":
        Image.fromarray(pixels).save(path, icc_profile=icc, lossless=True)
    else:
        Image.fromarray(pixels).save(path, icc_profile=icc)
    return path


def kinds_in(path: Path) -> set[str]:
    """The kinds of metadata that exiftool finds, all values of them right."""
    run = subprocess.run(["exiftool", "-j", "-n", "-G", str(path)], capture_output=True, text=True, check=True)
    found = json.loads(run.stdout)[0]
    kinds = {
        kind
        for kind, values in SAYS.items()
        if all(found.get(f"{GROUPS[kind]}:{name}") == value for name, value in values.items())
    }
    return kinds | ({"ICC profile"} if any(name.startswith("ICC_Profile:") for name in found) else set())


@needs_exiftool
@pytest.mark.parametrize("source", ["jpg", "tif", "png", "webp", "jp2"])
@pytest.mark.parametrize("target", ["jpg", "tif", "png", "webp", "jp2", "exr", "bmp", "tga", "dpx", "ppm", "hdr"])
def test_every_kind_is_kept_or_named(tmp_path: Path, source: str, target: str) -> None:
    path = picture(tmp_path / f"a.{source}")
    words = [word for kind, tags in TAGS.items() for word in tags if not (kind == "IPTC" and source in ("png", "webp"))]
    subprocess.run(["exiftool", "-q", "-overwrite_original", *words, str(path)], check=True)
    before = kinds_in(path)
    assert {"EXIF", "GPS", "XMP"} <= before
    done = apply_image(LutRecipe(write_cube(tmp_path / "a.cube")).grade(path), path, tmp_path / f"b.{target}")
    named = {kind for kind in before for note in done.notes if "were left out: " in note and kind in note}
    if target == "exr":  # its attributes have names that exiftool does not group
        return
    assert kinds_in(done.target) | named >= before
    assert not kinds_in(done.target) & named
    with Image.open(done.target) if target not in ("exr", "dpx", "hdr") else Image.new("RGB", (49, 33)) as image:
        assert image.convert("RGB").size == (49, 33)


def test_lossless_webp_stays_so(tmp_path: Path) -> None:
    path = picture(tmp_path / "a.webp")
    grade = LutRecipe(write_cube(tmp_path / "a.cube")).grade(path)
    assert read_packets(apply_image(grade, path, tmp_path / "b.webp").target).lossless


def test_no_film_and_no_gain_map_is_declared_that_is_not_there() -> None:
    xmp = (
        b'<rdf:Description GCamera:MotionPhoto="1" GCamera:MotionPhotoVersion="1" hdrgm:Version="1.0" xmp:Rating="3">'
        b"<Container:Directory><rdf:Seq><rdf:li/></rdf:Seq></Container:Directory></rdf:Description>"
    )
    assert declares_film(xmp)
    assert without_further_pictures(xmp) == b'<rdf:Description xmp:Rating="3"></rdf:Description>'


@pytest.mark.parametrize("part", [b" ", b" hdrgm:a ", b"<Container:Directory ", b"</Container:Directory "])
def test_a_long_packet_is_looked_through_once(part: bytes) -> None:
    """Cameras pad packets with 64 KB of spaces; a search that began anew at each byte of 8 MB would take hours."""
    packet = b"<rdf:Description" + part * ((8 << 20) // len(part)) + b"/>"
    assert without_further_pictures(packet) == packet
    assert not declares_film(packet)
    padded = packet.replace(b"/>", b' hdrgm:Version="1.0"/>')
    assert without_further_pictures(padded).rstrip(b" />") == packet.rstrip(b" />")


def test_an_animated_png_is_said(tmp_path: Path) -> None:
    frames = [Image.new("RGB", (20, 20), colour) for colour in ("red", "blue")]
    frames[0].save(tmp_path / "a.png", save_all=True, append_images=frames[1:])
    grade = LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.png")
    assert any("first frame" in note for note in apply_image(grade, tmp_path / "a.png", tmp_path / "b.png").notes)


@pytest.mark.parametrize(
    ("chunks", "encoding"),
    [
        ({b"cICP": bytes([9, 16, 0, 1])}, "PQ"),
        ({b"cICP": bytes([9, 18, 0, 1])}, "HLG"),
        ({b"gAMA": struct.pack(">I", 100_000)}, "linear"),
        ({b"gAMA": struct.pack(">I", 100_000), b"sRGB": b"\0"}, ""),
        ({b"gAMA": struct.pack(">I", 45_455)}, ""),
        ({b"cICP": bytes([1, 13, 0, 1]), b"gAMA": struct.pack(">I", 100_000)}, ""),
    ],
)
def test_a_png_says_how_it_is_encoded(tmp_path: Path, chunks: dict[bytes, bytes], encoding: str) -> None:
    Image.new("RGB", (8, 8), "green").save(tmp_path / "a.png")
    data = (tmp_path / "a.png").read_bytes()
    added = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))
        for name, body in chunks.items()
    )
    (tmp_path / "a.png").write_bytes(data[:33] + added + data[33:])
    assert read_packets(tmp_path / "a.png").encoding == encoding


def test_xmp_alone_names_the_editor(tmp_path: Path) -> None:
    for name, packet in (
        ("a.jpg", b'<rdf:Description xmp:CreatorTool="Adobe Photoshop 25.0 (Windows)"/>'),
        ("b.jpg", b"<stEvt:softwareAgent>Adobe Lightroom 7.1</stEvt:softwareAgent>"),
    ):
        Image.new("RGB", (8, 8)).save(tmp_path / name, xmp=packet)
        (note,) = edited_notes(tags(tmp_path / name))
        assert "wrote this file" in note
    Image.new("RGB", (8, 8)).save(tmp_path / "c.jpg", xmp=b'<rdf:Description xmp:CreatorTool="NIKON D750 Ver.1.10"/>')
    assert not edited_notes(tags(tmp_path / "c.jpg"))
