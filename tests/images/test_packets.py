"""Metadata of a picture: in every format that `apply` writes, each kind is there or named as lost."""

import json
import shutil
import struct
import subprocess
import zlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike
from PIL import Image, ImageCms, PngImagePlugin, TiffImagePlugin

from lutforge.errors import ImageError
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.packets import read_packets
from lutforge.images.read import ImageReader
from lutforge.images.xmp import declares_film, extended_segments, without_further_pictures
from tests.cases.pictures import write_cube, write_picture

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


def picture(path: Path) -> Path:
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    pixels = np.random.default_rng(0).integers(0, 256, (33, 49, 3), dtype=np.uint8)
    if path.suffix == ".webp":
        Image.fromarray(pixels).save(path, icc_profile=icc, lossless=True)
    else:
        Image.fromarray(pixels).save(path, icc_profile=icc)
    return path


SOURCES = ("jpg", "tif", "png", "webp", "jp2")
TARGETS = ("jpg", "tif", "png", "webp", "jp2", "exr", "bmp", "tga", "dpx", "ppm", "hdr")
Graded = tuple[set[str], set[str], set[str]]
"""Kinds of metadata in a source, in what was made of it, and those that its notes name as left out."""


def kinds_in(paths: Sequence[Path]) -> list[set[str]]:
    """The kinds of metadata that exiftool finds in each file, all values of them right."""
    run = subprocess.run(["exiftool", "-j", "-n", "-G", *map(str, paths)], capture_output=True, text=True, check=True)
    kinds = []
    for found in json.loads(run.stdout):
        right = {
            kind
            for kind, values in SAYS.items()
            if all(found.get(f"{GROUPS[kind]}:{name}") == value for name, value in values.items())
        }
        profiled = any(name.startswith("ICC_Profile:") for name in found)
        kinds.append(right | ({"ICC profile"} if profiled else set()))
    return kinds


def kinds_in_exr(path: Path) -> set[str]:
    """The kinds of metadata among the attributes of an OpenEXR file, whose names exiftool does not group."""
    with ImageReader(path) as reader:
        spec = reader.spec
    packet = spec.get_string_attribute("xmp")
    latitude = spec.getattribute("GPS:Latitude") or (0.0, 0.0, 0.0)
    kinds = {
        "EXIF": spec.get_float_attribute("Exif:FocalLength") == 35,
        "GPS": latitude[0] + latitude[1] / 60 == 52.5,
        "XMP": all(word in packet for word in (">4<", ">sea<", ">a shore<")),
        "IPTC": spec.get_string_attribute("IPTC:City") == "Berlin",
        "ICC profile": spec.getattribute("ICCProfile") is not None,
    }
    return {kind for kind, there in kinds.items() if there}


@pytest.fixture(scope="module")
def graded(tmp_path_factory: pytest.TempPathFactory) -> dict[tuple[str, str], Graded]:
    """Every format graded to every format; exiftool, which takes long to start, reads all files in one run."""
    if shutil.which("exiftool") is None:
        pytest.skip("needs exiftool")
    folder = tmp_path_factory.mktemp("packets")
    recipe = LutRecipe(write_cube(folder / "a.cube"))
    sources = {suffix: picture(folder / f"a.{suffix}") for suffix in SOURCES}
    for suffixes, kinds in ((("jpg", "tif", "jp2"), set(TAGS)), (("png", "webp"), set(TAGS) - {"IPTC"})):
        words = [word for kind in sorted(kinds) for word in TAGS[kind]]
        paths = [str(sources[suffix]) for suffix in suffixes]
        subprocess.run(["exiftool", "-q", "-overwrite_original", *words, *paths], check=True)
    done = {
        (source, target): apply_image(recipe.grade(path), path, folder / f"from_{source}.{target}")
        for source, path in sources.items()
        for target in TARGETS
    }
    before = dict(zip(SOURCES, kinds_in(list(sources.values())), strict=True))
    after = kinds_in([one.target for one in done.values()])
    after = [
        kinds_in_exr(one.target) if pair[1] == "exr" else kinds
        for (pair, one), kinds in zip(done.items(), after, strict=True)
    ]
    made = {}
    for (pair, one), kinds in zip(done.items(), after, strict=True):
        named = {kind for kind in before[pair[0]] for note in one.notes if "were left out: " in note and kind in note}
        with Image.open(one.target) if pair[1] not in ("exr", "dpx", "hdr") else Image.new("RGB", (49, 33)) as image:
            assert image.convert("RGB").size == (49, 33)
        made[pair] = before[pair[0]], kinds, named
    return made


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("target", TARGETS)
def test_every_kind_is_kept_or_named(graded: dict[tuple[str, str], Graded], source: str, target: str) -> None:
    before, after, named = graded[source, target]
    assert {"EXIF", "GPS", "XMP"} <= before
    assert after | named >= before
    assert not after & named


LONG_PACKET = (
    b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
    b'<rdf:Description xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmp:Rating="4" xmp:Label="' + b"a" * 70_000 + b'"/>'
    b"</rdf:RDF></x:xmpmeta>"
)


@pytest.mark.parametrize("target", ["png", "tif", "exr", "jp2", "webp"])
def test_xmp_beyond_64_kb_is_kept(tmp_path: Path, target: str) -> None:
    path = picture(tmp_path / "a.webp")
    Image.open(path).save(tmp_path / "b.webp", xmp=LONG_PACKET, lossless=True)
    grade = LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "b.webp")
    done = apply_image(grade, tmp_path / "b.webp", tmp_path / f"c.{target}")
    assert not any("left out" in note for note in done.notes)
    if target == "exr":  # and from there on
        done = apply_image(LutRecipe(tmp_path / "a.cube").grade(done.target), done.target, tmp_path / "d.png")
    assert read_packets(done.target).xmp == LONG_PACKET


def test_xmp_beyond_64_kb_gets_an_extension_in_a_jpeg(tmp_path: Path) -> None:
    """Which other programs read, and from which it comes back."""
    if shutil.which("exiftool") is None:
        pytest.skip("needs exiftool")
    path = picture(tmp_path / "a.webp")
    Image.open(path).save(tmp_path / "b.webp", xmp=LONG_PACKET, lossless=True)
    recipe = LutRecipe(write_cube(tmp_path / "a.cube"))
    jpeg = apply_image(recipe.grade(tmp_path / "b.webp"), tmp_path / "b.webp", tmp_path / "c.jpg")
    back = apply_image(recipe.grade(jpeg.target), jpeg.target, tmp_path / "d.png")
    again = apply_image(recipe.grade(jpeg.target), jpeg.target, tmp_path / "e.jpg")
    assert not any("left out" in note for done in (jpeg, back, again) for note in done.notes)
    paths = [str(done.target) for done in (jpeg, back, again)]
    run = subprocess.run(["exiftool", "-j", "-n", "-XMP:all", *paths], capture_output=True, text=True, check=True)
    for found in json.loads(run.stdout):
        assert found["Rating"] == 4
        assert len(found["Label"]) == 70_000
        assert "Warning" not in found
    assert b"HasExtendedXMP" not in read_packets(back.target).xmp


@pytest.mark.parametrize("damage", ["none", "a piece is missing", "another checksum", "names around it"])
@pytest.mark.parametrize("target", ["jpg", "png"])
def test_an_extension_of_xmp_is_kept_or_named(tmp_path: Path, target: str, damage: str) -> None:
    path = picture(tmp_path / "a.jpg")
    packet = LONG_PACKET.replace(b"xmlns:rdf", b'xmlns:a="b" xmlns:rdf') if "names" in damage else LONG_PACKET
    named, *pieces = extended_segments(packet)
    if damage == "a piece is missing":
        del pieces[1]
    stored = b"".join(segment.stored for segment in (named, *pieces))
    if damage == "another checksum":
        stored = stored.replace(b">a" if b">a" in stored else b"aaa", b"bbb", 1)
    data = path.read_bytes()
    path.write_bytes(data[:2] + stored + data[2:])
    done = apply_image(LutRecipe(write_cube(tmp_path / "a.cube")).grade(path), path, tmp_path / f"b.{target}")
    lost = any("beyond 64 kB" in note for note in done.notes)
    assert lost == (target == "png" and damage != "none")
    assert (stored in done.target.read_bytes()) == (target == "jpg")
    if target == "png" and damage == "none":
        assert b'xmp:Rating="4"' in read_packets(done.target).xmp


@pytest.mark.parametrize("target", ["jpg", "png", "tif", "webp", "jp2", "bmp"])
def test_xmp_of_heif_is_kept_or_named(tmp_path: Path, target: str) -> None:
    heif = pytest.importorskip("pillow_heif", reason="needs pillow-heif")
    packet = b'<x:xmpmeta xmlns:x="adobe:ns:meta/"/>'
    heif.from_pillow(Image.open(picture(tmp_path / "a.png"))).save(tmp_path / "a.heic", quality=-1, xmp=packet)
    grade = LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.heic")
    done = apply_image(grade, tmp_path / "a.heic", tmp_path / f"b.{target}")
    if target == "bmp":
        assert any("left out: XMP" in note for note in done.notes)
    else:
        assert read_packets(done.target).xmp == packet


@pytest.mark.parametrize(
    "resources", [b"8BIM", b"8BIM\4\4", b"8BIM\4\4\0\0\xff\xff\xff\xff", b"8BIM\4\4\xff" + bytes(9), b"other"]
)
def test_damaged_resources_hold_no_iptc(tmp_path: Path, resources: bytes) -> None:
    path = picture(tmp_path / "a.jpg")
    body, data = b"Photoshop 3.0\0" + resources, path.read_bytes()
    path.write_bytes(data[:2] + b"\xff\xed" + struct.pack(">H", len(body) + 2) + body + data[2:])
    assert read_packets(path).iptc == b""


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
    elements = (
        b'<rdf:Description xmp:Rating="3"><hdrgm:Version>1.0</hdrgm:Version><hdrgm:GainMapMax><rdf:Seq>'
        b"<rdf:li>1.4</rdf:li></rdf:Seq></hdrgm:GainMapMax><hdrgm:BaseRenditionIsHDR/></rdf:Description>"
    )
    assert without_further_pictures(elements) == b'<rdf:Description xmp:Rating="3"></rdf:Description>'


@pytest.mark.parametrize(
    ("space", "stated"),
    [
        (b"http://ns.adobe.com/hdr-gain-map/1.0/", b'ns1:Version="1.0"'),
        (b"http://ns.apple.com/HDRGainMap/1.0/", b"ns1:HDRGainMapVersion='65536'"),
        (b"http://ns.google.com/photos/1.0/camera/", b'ns1:MotionPhoto="1"'),
        (b"http://ns.google.com/photos/1.0/container/", b"><ns1:Directory><rdf:Seq/></ns1:Directory"),
    ],
)
def test_nor_by_another_prefix_of_its_namespace(space: bytes, stated: bytes) -> None:
    declared = b'<rdf:Description xmlns:ns1="' + space + b'"'
    assert without_further_pictures(declared + b" " + stated + b">").strip(b" >") == declared
    other = b'<rdf:Description xmlns:ns1="http://example.org/" ' + stated + b">"
    assert without_further_pictures(other) == other


@pytest.mark.parametrize("source", ["jpg", "tif", "png", "webp", "jp2", "heic"])
def test_maker_notes_and_the_user_comment_are_kept_or_named(tmp_path: Path, source: str) -> None:
    path = tmp_path / f"a.{source}"
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({0x927C: b"a camera's own", 0x9286: b"ASCII\0\0\0seen"})
    if source == "heic":
        heif = pytest.importorskip("pillow_heif", reason="needs pillow-heif")
        heif.from_pillow(Image.new("RGB", (64, 64))).save(str(path), exif=exif.tobytes())
    else:
        Image.new("RGB", (64, 64)).save(path, exif=exif.tobytes())
    if source == "jp2":  # which Pillow gives no EXIF
        body = b"JpgTiffExif->JP2" + exif.tobytes().removeprefix(b"Exif\0\0")
        box = struct.pack(">I", len(body) + 8) + b"uuid" + body
        data = path.read_bytes()
        at = data.index(b"jp2c") - 4
        path.write_bytes(data[:at] + box + data[at:])
    recipe = LutRecipe(write_cube(tmp_path / "a.cube"))
    for target in ("jpg", "png", "tif"):
        done = apply_image(recipe.grade(path), path, tmp_path / f"b.{target}")
        named = [all(word in note for word in ("maker notes", "user comment")) for note in done.notes]
        assert any(named) == (not source == target == "jpg")
        if source == target == "jpg":
            assert b"a camera's own" in done.target.read_bytes()


def test_an_empty_user_comment_is_no_loss(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0x9286] = b"ASCII\0\0\0" + b" " * 36
    Image.new("RGB", (64, 64)).save(tmp_path / "a.jpg", exif=exif.tobytes())
    done = apply_image(
        LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.jpg"), tmp_path / "a.jpg", tmp_path / "b.png"
    )
    assert done.notes == ()


@pytest.mark.parametrize(
    "part", [b" ", b" hdrgm:a ", b"<hdrgm:a>", b"<hdrgm:a", b"<Container:Directory ", b"</Container:Directory "]
)
def test_a_long_packet_is_looked_through_once(part: bytes) -> None:
    """Cameras pad packets with 64 KB of spaces; a search that began anew at each byte of 2 MB would take hours."""
    packet = b"<rdf:Description" + part * ((2 << 20) // len(part)) + b"<x/>"
    assert without_further_pictures(packet) == packet
    assert not declares_film(packet)
    padded = packet.replace(b"<x/>", b' hdrgm:Version="1.0"<x/>')
    assert without_further_pictures(padded).replace(b" ", b"") == packet.replace(b" ", b"")


@pytest.mark.parametrize("source", ["png", "jpg", "tif"])
def test_texts_beyond_ascii_stay_readable_in_a_png(tmp_path: Path, source: str) -> None:
    """A PNG's tEXt chunk is Latin-1, its iTXt chunk UTF-8."""
    text, path = "Straße in 東京", tmp_path / f"a.{source}"
    if source == "png":
        described = PngImagePlugin.PngInfo()
        described.add_itxt("Description", text)
        described.add_text("Author", "Jörg")
        Image.new("RGB", (8, 8)).save(path, pnginfo=described)
    else:
        exif = Image.Exif()
        exif[0x010E] = text.encode()
        Image.new("RGB", (8, 8)).save(path, exif=exif)
    recipe = LutRecipe(write_cube(tmp_path / "a.cube"))
    for _ in range(2):  # and of what was made
        path = apply_image(recipe.grade(path), path, tmp_path / f"b_{path.stem}.png").target
        with Image.open(path) as picture:
            assert isinstance(picture, PngImagePlugin.PngImageFile)
            assert picture.text["Description"] == text
            assert source != "png" or picture.text["Author"] == "Jörg"


def test_an_animated_png_is_said(tmp_path: Path) -> None:
    frames = [Image.new("RGB", (20, 20), colour) for colour in ("red", "blue")]
    frames[0].save(tmp_path / "a.png", save_all=True, append_images=frames[1:])
    grade = LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.png")
    assert any("first frame" in note for note in apply_image(grade, tmp_path / "a.png", tmp_path / "b.png").notes)


def corners(*primaries: float) -> bytes:
    """A PNG's cHRM of these chromaticities of red, green and blue, and daylight."""
    return struct.pack(">8I", *(round(100_000 * value) for value in (0.3127, 0.329, *primaries)))


@pytest.mark.parametrize(
    ("chunks", "encoding"),
    [
        ({b"cICP": bytes([9, 16, 0, 1])}, "PQ"),
        ({b"cICP": bytes([9, 18, 0, 1])}, "HLG"),
        ({b"cICP": bytes([9, 1, 0, 1])}, "the primaries of BT.2020"),
        ({b"cICP": bytes([12, 13, 0, 1])}, "the primaries of Display P3"),
        ({b"cICP": bytes([1, 13, 0, 0])}, "video levels, 16 to 235"),
        ({b"gAMA": struct.pack(">I", 100_000)}, "linear light"),
        ({b"gAMA": struct.pack(">I", 55_556)}, "gamma 1.80"),
        ({b"gAMA": struct.pack(">I", 45_455), b"cHRM": corners(0.64, 0.33, 0.3, 0.6, 0.15, 0.06)}, ""),
        ({b"cHRM": corners(0.64, 0.33, 0.21, 0.71, 0.15, 0.06)}, "the primaries of Adobe RGB"),
        ({b"cHRM": corners(0.68, 0.32, 0.265, 0.69, 0.15, 0.06)}, "the primaries of Display P3"),
        ({b"cHRM": corners(0.7, 0.3, 0.2, 0.7, 0.15, 0.06)}, "other primaries than sRGB's"),
        ({b"cHRM": corners(0.7, 0.3, 0.2, 0.7, 0.15, 0.06), b"sRGB": b"\0"}, ""),
        ({b"cHRM": b"short"}, ""),
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


@pytest.mark.parametrize(
    ("name", "values", "encoding"),
    [
        ("PrimaryChromaticities", (0.708, 0.292, 0.17, 0.797, 0.131, 0.046), "the primaries of BT.2020"),
        ("PrimaryChromaticities", (0.64, 0.33, 0.3, 0.6, 0.15, 0.06), ""),
        ("TransferFunction", np.linspace(0, 65535, 256), "linear light"),
        ("TransferFunction", 65535 * np.linspace(0, 1, 256) ** 1.8, "gamma 1.80"),
        ("TransferFunction", 65535 * np.linspace(0, 1, 256) ** 2.2, ""),
        ("TransferFunction", np.zeros(256), ""),
        ("TransferFunction", np.linspace(0, 65535, 256)[:3], ""),
    ],
)
def test_a_tiff_says_how_it_is_encoded(tmp_path: Path, name: str, values: ArrayLike, encoding: str) -> None:
    directory = TiffImagePlugin.ImageFileDirectory_v2()
    numbers = np.asarray(values)
    if name == "TransferFunction":
        directory[301] = tuple(np.rint(numbers).astype(int).tolist()) * 3
        directory.tagtype[301] = 3
    else:
        directory[318] = (0.3127, 0.329)
        directory[319] = tuple(numbers.tolist())
        directory.tagtype |= {318: 5, 319: 5}
    Image.new("RGB", (8, 8), "green").save(tmp_path / "a.tif", tiffinfo=directory)
    assert read_packets(tmp_path / "a.tif").encoding == encoding
    icc = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    Image.new("RGB", (8, 8), "green").save(tmp_path / "b.tif", tiffinfo=directory, icc_profile=icc)
    assert read_packets(tmp_path / "b.tif").encoding == ""


@pytest.mark.parametrize(("kind", "encoding"), [("pq_rec2020_display", "PQ"), ("lin_rec709_scene", ""), ("", "")])
def test_a_grade_for_srgb_refuses_an_exr_that_is_encoded_otherwise(tmp_path: Path, kind: str, encoding: str) -> None:
    write_picture(tmp_path / "a.exr", kind="half", colorInteropID=kind)
    grade = replace(LutRecipe(write_cube(tmp_path / "a.cube")).grade(tmp_path / "a.exr"), for_srgb=True)
    if encoding:
        with pytest.raises(ImageError, match=f"its colours are in {encoding}, and this grade is for sRGB"):
            apply_image(grade, tmp_path / "a.exr", tmp_path / "b.exr")
    else:
        apply_image(grade, tmp_path / "a.exr", tmp_path / "b.exr")


@pytest.mark.parametrize("suffix", ["gif", "webp", "png", "tif", "heic"])
def test_every_file_of_several_pictures_says_that_one_is_graded(tmp_path: Path, suffix: str) -> None:
    frames = [Image.new("RGB", (64, 64), colour) for colour in ("red", "blue")]
    path = tmp_path / f"a.{suffix}"
    if suffix == "heic":
        heif = pytest.importorskip("pillow_heif", reason="needs pillow-heif")
        both = heif.from_pillow(frames[0])
        both.add_from_pillow(frames[1])
        both.save(str(path))
    else:
        frames[0].save(path, save_all=True, append_images=frames[1:])
    done = apply_image(LutRecipe(write_cube(tmp_path / "a.cube")).grade(path), path, tmp_path / "b.tif")
    assert any("first of 2 images" in note or "first frame" in note for note in done.notes)
