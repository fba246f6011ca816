"""Settings from tags: known values of real files, codes and multipliers of the makers, damaged metadata."""

import struct
import time
from pathlib import Path

import numpy as np
import pytest

from lutforge.images.raw import read_raw
from lutforge.settings import StyleName
from lutforge.shots.maker_multipliers import kelvin_of, multipliers_of
from lutforge.shots.maker_settings import notes_of, style_of, white_balance_of
from lutforge.shots.metadata import read_metadata, read_picture_settings, tidy_camera
from lutforge.shots.tags import Tags, key_of, maker_table, tags_of
from lutforge.shots.tags import tags as file_tags
from tests.cases.damaged import damaged


def style_text(tags: Tags) -> str | None:
    """The style as tables and selectors write it."""
    style = style_of(tags)
    if style is not None:
        assert StyleName.parse(str(style)) == style
    return None if style is None else str(style)


@pytest.mark.parametrize(
    ("file", "camera", "exposure", "iso", "known"),
    [
        # exposures: CIFF record 0x1818 through LibRaw; settings agree with exiv2 0.28
        ("canon_powershot_s40/CRW_0101.CRW", "Canon PowerShot S40", 2 ** -(213 / 32), 50, True),
        ("canon_powershot_s40/CRW_0117.CRW", "Canon PowerShot S40", 1 / 4, 50, True),
        ("canon_powershot_s40/CRW_0118.CRW", "Canon PowerShot S40", 1 / 8, 50, True),
        ("canon_eos_d30/Canon_D30_imagemeta_CRW.CRW", "Canon EOS D30", 2 ** (74 / 32), 100, False),
    ],
)
def test_crw(shared_data: Path, file: str, camera: str, exposure: float, iso: float, known: bool) -> None:
    path = shared_data / file
    found = read_metadata(path, read_raw(path, half_size=True), None)
    assert (found.camera, found.style, found.white_balance) == (camera, "standard", "auto")
    assert found.exposure_s == pytest.approx(exposure, rel=1e-3)
    assert found.iso == iso
    assert (found.multipliers is not None) == known
    assert any("multipliers" in note for note in found.notes) == (not known)


@pytest.mark.parametrize(
    ("file", "camera", "style", "white_balance", "multipliers", "note"),
    [
        # multipliers: the tags' levels, over 256 (Nikon 0x000c) and 8192 (Pentax 0x0201)
        ("Nikon_D90_DSC_0003", "Nikon D90", "portrait", "daylight", (461 / 256, 1, 335 / 256), "Active D-Lighting"),
        ("Pentax_ist_DL_IMGP6667", "Pentax *ist DL", "bright", "auto", (12736 / 8192, 1, 8000 / 8192), ""),
        ("Sony_A6400_DSC00007", "Sony ILCE-6400", "standard", "auto", None, "D-Range Optimizer"),
        ("Canon_PowerShot_G6_IMG_0003", "Canon PowerShot G6", "standard", "auto", None, ""),
        ("Kodak_DC280_DCP_4394", "Kodak DC280 ZOOM DIGITAL CAMERA", "unknown", "unknown", None, ""),
    ],
)
def test_real_pictures(
    shared_data: Path,
    file: str,
    camera: str,
    style: str,
    white_balance: str,
    multipliers: tuple[float, ...] | None,
    note: str,
) -> None:
    found = read_picture_settings(shared_data / "chart_jpegs" / f"{file}.JPG")
    assert (found.camera, found.style, found.white_balance) == (camera, style, white_balance)
    assert (found.multipliers is None) == (multipliers is None)
    if found.multipliers is not None and multipliers is not None:
        np.testing.assert_allclose(found.multipliers, multipliers)
    assert [line.startswith(note) for line in found.notes] == ([True] if note else [])


def test_a_brand_is_named_once_and_by_the_model() -> None:
    assert tidy_camera("RICOH IMAGING COMPANY, LTD.", "PENTAX K-3") == "Pentax K-3"
    assert tidy_camera("LutForge", "Simulated") == "LutForge Simulated"


@pytest.mark.parametrize(
    ("tags", "style"),
    [
        ({("CanonCs", 13): (0,), ("CanonCs", 14): (1,)}, "standard saturation+1"),
        ({("CanonCs", 13): (0xFFFF,), ("CanonCs", 14): (0,)}, "standard contrast-1"),
        ({("CanonCs", 14): (0,), ("CanonPr", 10): (0x83,)}, "landscape"),
        ({("NikonPc", 4): "VIVID", ("NikonPc", 53): (0x82,)}, "vivid saturation+2"),
        ({("NikonPc", 4): "FLAT", ("NikonPc", 0): (4,), ("NikonPc", 51): (0x7E,)}, "flat contrast-0.5"),
        ({("Nikon", 0x00A9): "CUSTOM", ("Nikon", 0x00AA): "ENHANCED"}, "custom saturation+1"),
        ({("Sony", 0xB020): "Landscape"}, "landscape"),
        ({("Sony", 0xB020): "ST", ("Sony", 0x2033): (-3,)}, "st highlights-3"),
        (
            {("Fujifilm", 0x1401): (0,), ("Fujifilm", 0x1040): (32,), ("Fujifilm", 0x1041): (-64,)},
            "provia highlights+4 shadows-2",
        ),
        ({("Pentax", 0x004F): (1,), ("Pentax", 0x001F): (4, 0), ("Pentax", 0x0020): (1,)}, "bright saturation+1"),
        ({("Panasonic", 0x0089): (2,), ("Panasonic", 0x0039): (0xFFFE,)}, "vivid contrast-2"),
        ({("OlympusCs", 0x0520): (1,), ("OlympusCs", 0x0523): (1, -2, 2)}, "vivid contrast+1"),
        ({("Sigma", 0x002C): (4,)}, "vivid"),
        ({("NikonPc", 4): "STANDARD", ("Iop", 1): "R03"}, "standard adobe rgb"),
        ({("CanonPr", 10): (0x81,), ("Canon", 0x00B4): (1,), ("Photo", 0xA001): (1,)}, "standard"),
        ({("Fujifilm", 0x1401): (0x600,)}, "classic chrome"),
        ({("OlympusCs", 0x0520): (3, 1)}, "muted"),
        ({("Photo", 0xA409): (2,)}, "standard saturation+1"),
        ({("Photo", 0xA409): (0,), ("Image", 0x010F): "Canon"}, None),
        ({("Photo", 0xA409): (0,), ("Photo", 0x927C): (1,), ("Image", 0x010F): "Minolta Co., Ltd."}, None),
        ({("Photo", 0xA409): (0,), ("Panasonic", 0x0003): (1,), ("Image", 0x010F): "Panasonic"}, "standard"),
        ({("Panasonic", 0x0028): (3,), ("Photo", 0xA409): (0,)}, "cool"),
        ({("Nikon", 0x00A9): "CUSTOM", ("Nikon", 0x008D): "MODE3a"}, "custom mode 3"),
        ({}, None),
    ],
)
def test_styles(tags: Tags, style: str | None) -> None:
    assert style_text(tags) == style


@pytest.mark.parametrize(
    ("tags", "white_balance"),
    [
        ({("Photo", 0xA403): (0,), ("Photo", 0x9208): (2,)}, "auto"),  # a Motorola XT912 under fluorescent light
        ({("Photo", 0xA403): (1,), ("Photo", 0x9208): (2,)}, "fluorescent"),
        ({("Photo", 0x9208): (10,)}, "cloudy"),
        ({("CanonSi", 7): (1,), ("CanonPr", 12): (0,), ("CanonPr", 13): (0,)}, "daylight"),
        ({("CanonSi", 7): (1,), ("CanonPr", 12): (2,), ("CanonPr", 13): (0xFFFD,)}, "daylight shift+2-3"),
        ({("Nikon", 5): "SUNNY", ("Nikon", 0x000B): (0xFFFE, 0)}, "daylight shift-2+0"),
        ({("Nikon", 5): "SUNNY", ("Nikon", 0x000B): (-2,)}, "daylight shift-2"),
        ({("Nikon", 5): "AUTO", ("Nikon", 0x000B): (-2, 0)}, "auto"),
        ({("Sony", 0x0115): (0x10,), ("Sony", 0x2014): (0, 1)}, "daylight shift+0+1"),
        ({("Fujifilm", 0x1002): (0xFF0,), ("Fujifilm", 0x1005): (5600,), ("Fujifilm", 0x100A): (20, 0)},
         "5600k shift+20+0"),
        ({("Panasonic", 3): (2,), ("Panasonic", 0x46): (0xFFFF,), ("Panasonic", 0x47): (0,)}, "daylight shift-1+0"),
    ],
)  # fmt: skip
def test_white_balances(tags: Tags, white_balance: str) -> None:
    assert white_balance_of(tags) == white_balance


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


def test_old_nikons_automatic_contrast_is_told() -> None:
    assert "automatic contrast" in next(notes_of({("Nikon", 0x0081): "AUTO    "}))
    assert list(notes_of({("Nikon", 0x0081): "NORMAL"})) == []


def tiff_with_note(note: bytes, make: bytes = b"NIKON CORPORATION\0", order: str = ">") -> bytes:
    """First directory: Make, and the EXIF directory with nothing but a maker note."""
    start = 8 + 2 + 24 + 4
    first = struct.pack(order + "HHHIIHHII", 2, 0x010F, 2, len(make), start, 0x8769, 4, 1, start + len(make))
    exif = struct.pack(order + "HHHIII", 1, 0x927C, 7, len(note), start + len(make) + 18, 0)
    head = {">": b"MM", "<": b"II"}[order] + struct.pack(order + "HI", 42, 8)
    return head + first + bytes(4) + make + exif + note


@pytest.mark.parametrize(
    ("version", "name", "contrast", "style"),
    [
        (b"0100", 4, 51, "vivid contrast+2"),
        (b"0200", 4, 55, "vivid contrast+0.5"),
        (b"0310", 8, 63, "vivid contrast+0.5"),
    ],
)
def test_each_version_of_nikons_picture_controls(version: bytes, name: int, contrast: int, style: str) -> None:
    control = bytearray([0x80]) * 74
    control[:4], control[name : name + 20], control[contrast] = version, b"VIVID".ljust(20, b"\0"), 0x82
    note = b"Nikon\0\2\x10\0\0MM\0*\0\0\0\x08" + struct.pack(">HHHIII", 1, 0x0023, 7, len(control), 26, 0)
    tags = tags_of(tiff_with_note(note + bytes(control)))
    assert style_text(tags) == style
    assert list(notes_of(tags)) == []
    control[contrast] = 0
    assert "automatic contrast" in next(notes_of(tags_of(tiff_with_note(note + bytes(control)))))


@pytest.mark.parametrize("order", ["<", ">"])
def test_a_note_in_the_other_byte_order_than_it_states(order: str) -> None:
    """As of a Pentax *ist DL, after a program that rewrote the file."""
    note = b"AOC\0MM" + struct.pack(order + "HHHIHHI", 1, 0x004F, 3, 1, 1, 0, 0)
    assert style_text(tags_of(tiff_with_note(note, b"PENTAX\0", ">"))) == "bright"


PENTAX_DNG = b"PENTAX \0MM" + struct.pack("<HHHII", 1, 0x004F, 3, 1, 3)
"""As a K-3 writes it: little-endian, whatever it says."""

NOTE = b"SONY DSC \0\0\0" + struct.pack("<HHHII", 1, 0xB020, 2, 8, 1000 + 26) + b"Vivid\0\0\0"
MOVED_NOTE = b"Adobe\0MakN" + struct.pack(">I", 6 + len(NOTE)) + b"II" + struct.pack(">I", 1000) + NOTE
"""As Adobe's converter keeps the note of another file, where it stood at byte 1000."""


@pytest.mark.parametrize(("private", "style"), [(PENTAX_DNG, "landscape"), (MOVED_NOTE, "vivid")])
def test_the_maker_note_in_a_dngs_private_data(private: bytes, style: str) -> None:
    first = struct.pack("<HHHII", 1, 0xC634, 1, len(private), 8 + 2 + 12)
    assert style_text(tags_of(b"II" + struct.pack("<HI", 42, 8) + first + private)) == style


def ciff(entries: list[tuple[int, bytes]]) -> bytes:
    heap, directory = b"", b""
    for tag, body in entries:
        directory += struct.pack("<HII", tag, len(body), len(heap))
        heap += body
    heap += (start := struct.pack("<H", len(entries)) + directory) and b""
    return b"II" + struct.pack("<I", 26) + b"HEAPCCDR" + bytes(12) + heap + start + struct.pack("<I", len(heap))


def test_ciff_records() -> None:
    data = ciff([(0x080A, b"Canon\0Canon EOS X\0"), (0x102D, struct.pack("<16H", 32, *[0] * 13, 1, 0))])
    tags = tags_of(data)
    assert tags["Image", 0x0110] == "Canon EOS X"
    assert style_text(tags) == "standard saturation+1"


def test_ciff_that_contains_itself_ends() -> None:
    data = ciff([(0x300A, b"")] * 40)
    directory = len(data) - 4 - 400
    loop = bytearray(data)
    for index in range(40):  # each subheap is the whole heap again
        struct.pack_into("<HII", loop, directory + 10 * index, 0x300A, len(data) - 26, 0)
    assert tags_of(bytes(loop)) == {}


def test_damaged_metadata_never_raises(shared_data: Path) -> None:
    rng = np.random.default_rng(0)
    for file in ("chart_jpegs/Nikon_D90_DSC_0003.JPG", "canon_powershot_s40/CRW_0101.CRW"):
        whole = (shared_data / file).read_bytes()
        data = whole[:20_000] if file.endswith("JPG") else whole[:1000] + whole[-20_000:]
        for _ in range(100):
            tags = tags_of(damaged(data, rng))
            words = (str(style_of(tags)), white_balance_of(tags), *notes_of(tags))
            assert all(word is None or word.isprintable() for word in words)


def test_endless_metadata_end_and_nothing_is_printed(
    tmp_path: Path, capfd: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    entries = b"".join(struct.pack("<HHII", tag, 3, 999, 8) for tag in range(1, 60_000))
    (tmp_path / "a.tif").write_bytes(b"II" + struct.pack("<HIH", 42, 8, 59_999) + entries + bytes(4))
    start = time.process_time()
    assert len(file_tags(tmp_path / "a.tif")) < 1000
    assert time.process_time() - start < 3
    (tmp_path / "b.jpg").write_bytes(b"\xff\xd8\xff\xe1\0\x10Exif\0\0II*\0\xff\xff\xff\xff")
    assert file_tags(tmp_path / "b.jpg") == {}
    assert capfd.readouterr() == ("", "")
    assert not caplog.records


def test_tables_name_known_groups_and_codes() -> None:
    settings, notes = maker_table("settings"), maker_table("maker_notes")
    groups = {row["group"] for row in notes["notes"]} | {group for group, _ in notes["arrays"]["tags"].values()}
    groups |= {"Image", "Photo", "Iop", "NikonPc", "OlympusCs", "OlympusIp"}
    for name, table in settings.items():
        for text in table.get("tags", ()) if isinstance(table, dict) else ():
            for key in text if isinstance(text, list) else [text]:
                assert key_of(key)[0] in groups, (name, key)
    for table in ("styles", "effects", "white_balances"):
        for names in settings[table]["tags"].values():
            assert all(hex(int(code, 16)) == code for code in names)
