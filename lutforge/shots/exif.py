"""EXIF and maker notes as numbers: (group, tag) → integers or text. Groups are named as exiv2 names them.

Read from TIFF-like RAW files (NEF, CR2, ARW, DNG, PEF, ORF, RW2, SRW …), JPEG, RAF, MRW, CR3 and CRW. Nothing
is raised for
damaged metadata: what cannot be read is not there. Layouts: TIFF 6.0; Exif 2.32; exiv2.org/makernote.html;
exiftool.org/TagNames.
"""

import struct
from dataclasses import dataclass

from lutforge.errors import ImageError
from lutforge.shots.ciff import CAMERA_SETTINGS, MAKE_AND_MODEL, SHOT_INFO, Buffer, is_ciff, read_ciff
from lutforge.shots.jpeg_header import read_jpeg_header

Value = str | tuple[int, ...]
Tags = dict[tuple[str, int], Value]

MAX_DIRECTORIES = 64
MAX_ENTRIES = 1000
MAX_VALUE_BYTES = 8192
"""Longer values are pictures and tables; they are cut to this."""

_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 13: 4}
_CODES = {1: "B", 3: "H", 4: "I", 5: "I", 6: "b", 7: "B", 8: "h", 9: "i", 10: "i", 13: "I"}
_TIFF_MAGIC = (42, 0x55, 0x4F52, 0x5352)  # TIFF, RW2, ORF, ORF

_CANON_ARRAYS = {
    0x0001: ("CanonCs", "H"),
    0x0004: ("CanonSi", "H"),
    0x0027: ("CanonContrastInfo", "H"),
    0x00A0: ("CanonPr", "H"),
    0x4018: ("CanonLiOp", "I"),
    0x4025: ("CanonHdr", "I"),
}

_NIKON_PICTURE_CONTROLS = {b"01": (4, 1, 51, 52, 53), b"02": (4, 4, 55, 57, 59), b"03": (8, 4, 63, 65, 67)}
"""By version: where the name stands, numbers a step, and where contrast, brightness and saturation stand."""


def read_exif(data: Buffer) -> Tags:
    """All tags of a file's bytes (a memory map will do), empty where it holds none."""
    try:
        head = bytes(data[:32])
        if is_ciff(head):
            return _from_ciff(data)
        if head[:2] == b"\xff\xd8":
            return read_tiff(read_jpeg_header(bytes(data[:]), "").exif)
        if head[:15] == b"FUJIFILMCCD-RAW":
            start, length = struct.unpack_from(">II", data, 84)
            return read_tiff(read_jpeg_header(bytes(data[start : start + min(length, 1 << 27)]), "").exif)
        if head[:4] == b"\0MRM":
            return _from_mrw(data)
        if head[4:12] == b"ftypcrx ":
            return _from_cr3(data)
        return read_tiff(data)
    except (struct.error, ImageError, IndexError):
        return {}


def read_tiff(data: Buffer) -> Tags:
    """Tags of a TIFF structure: first directory, EXIF directory, maker note (in a DNG file also its private data)."""
    order = {b"II": "<", b"MM": ">"}.get(bytes(data[:2]))
    if order is None or len(data) < 8 or struct.unpack_from(order + "H", data, 2)[0] not in _TIFF_MAGIC:
        return {}
    reader = _Reader(data, {}, [MAX_DIRECTORIES])
    (first,) = struct.unpack_from(order + "I", data, 4)
    entries = reader.directory("Image", order, 0, first)
    pointer, private = entries.get(0x8769), entries.get(0xC634)
    if pointer is not None:
        (exif,) = struct.unpack_from(order + "I", data, pointer.position)
        photo = reader.directory("Photo", order, 0, exif)
        note, interoperability = photo.get(0x927C), photo.get(0xA005)
        if note is not None:
            reader.maker_note(order, note.position)
        if interoperability is not None:
            (offset,) = struct.unpack_from(order + "I", data, interoperability.position)
            reader.directory("Iop", order, 0, offset)
    if private is not None:
        reader.private_data(order, private.position)
    return reader.tags


@dataclass(frozen=True)
class _Entry:
    """Where a directory entry's value lies."""

    position: int
    size: int


@dataclass(frozen=True)
class _Reader:
    data: Buffer
    tags: Tags
    budget: list[int]

    def directory(self, group: str, order: str, base: int, offset: int) -> dict[int, _Entry]:
        """Read one directory at base + offset into `tags`; its entries' places."""
        start, found = base + offset, dict[int, _Entry]()
        if self.budget[0] <= 0 or start < 0 or start + 2 > len(self.data):
            return found
        self.budget[0] -= 1
        (count,) = struct.unpack_from(order + "H", self.data, start)
        for index in range(min(count, MAX_ENTRIES)):
            entry = start + 2 + 12 * index
            if entry + 12 > len(self.data):
                break
            tag, kind, length = struct.unpack_from(order + "HHI", self.data, entry)
            if kind not in _SIZES:
                continue
            size = _SIZES[kind] * length
            position = entry + 8 if size <= 4 else base + struct.unpack_from(order + "I", self.data, entry + 8)[0]
            if position < 0 or position + size > len(self.data):
                continue
            found.setdefault(tag, _Entry(position, size))
            self.tags.setdefault((group, tag), self._value(order, kind, position, size))
        return found

    def _value(self, order: str, kind: int, position: int, size: int) -> Value:
        raw = bytes(self.data[position : position + min(size, MAX_VALUE_BYTES)])
        if kind == 2:
            return _text(raw)
        code = _CODES[kind]
        count = len(raw) // struct.calcsize(code)
        return tuple(struct.unpack_from(f"{order}{count}{code}", raw))

    def maker_note(self, order: str, start: int, base: int = 0) -> None:
        """Recognise the maker by the note's own signature, else by the Make. Offsets count from `base`, where the note
        does not say otherwise."""
        head = bytes(self.data[start : start + 20])
        here = start - base
        if head[:6] == b"Nikon\0" and head[10:12] in (b"II", b"MM"):
            inner = "<" if head[10:12] == b"II" else ">"
            (offset,) = struct.unpack_from(inner + "I", self.data, start + 14)
            self._nikon(self.directory("Nikon", inner, start + 10, offset))
        elif head[:6] == b"Nikon\0":
            self.directory("Nikon1", order, base, here + 8)
        elif head[:8] == b"OLYMPUS\0":
            inner = "<" if head[8:10] == b"II" else ">"
            self._olympus(self.directory("Olympus", inner, start, 12), inner, start)
        elif head[:12] == b"OM SYSTEM\0\0\0":
            inner = "<" if head[12:14] == b"II" else ">"
            self._olympus(self.directory("Olympus", inner, start, 16), inner, start)
        elif head[:5] == b"OLYMP":
            self._olympus(self.directory("Olympus", order, base, here + 8), order, base)
        elif head[:8] == b"FUJIFILM":
            (offset,) = struct.unpack_from("<I", self.data, start + 8)
            self.directory("Fujifilm", "<", start, offset)
        elif head[:9] == b"Panasonic":
            self.directory("Panasonic", order, base, here + 12)
        elif head[:8] == b"PENTAX \0":
            self.directory("Pentax", self._likely_order(start + 10, head[8:10], order), start, 10)
        elif head[:4] == b"AOC\0":
            self.directory("Pentax", self._likely_order(start + 6, head[4:6], order), base, here + 6)
        elif head[:8] in (b"SIGMA\0\0\0", b"FOVEON\0\0"):
            self.directory("Sigma", order, base, here + 10)
        elif head[:4] == b"SONY":
            self.directory("Sony", order, base, here + 12)
        else:
            self._unsigned_note(order, start, base)

    def private_data(self, order: str, start: int) -> None:
        """DNGPrivateData: a maker note as a camera writes it into its own DNG, or as Adobe's converter moved it there:
        "Adobe", block "MakN", its length, byte order, the note's offset in the old file, the note."""
        head = bytes(self.data[start : start + 20])
        if head[:10] == b"Adobe\0MakN" and head[14:16] in (b"II", b"MM"):
            (offset,) = struct.unpack_from(">I", head, 16)
            self.maker_note("<" if head[14:16] == b"II" else ">", start + 20, start + 20 - offset)
        elif head[:4] == b"AOC\0" or head[:8] == b"PENTAX \0":
            self.maker_note(order, start)

    def _likely_order(self, start: int, said: bytes, order: str) -> str:
        """The byte order that a note states, unless no directory has that many entries: programs that rewrite a file
        in the other order leave the note as it was, or change only what states it."""
        order = {b"II": "<", b"MM": ">"}.get(said, order)
        (count,) = struct.unpack_from(order + "H", self.data, start)
        return order if count < 256 else {"<": ">", ">": "<"}[order]

    def _unsigned_note(self, order: str, start: int, base: int) -> None:
        make = str(self.tags.get(("Image", 0x010F), "")).lower()
        for brand, group in (
            ("canon", "Canon"),
            ("nikon", "Nikon"),
            ("sony", "Sony"),
            ("samsung", "Samsung"),
        ):
            if make.startswith(brand):
                self._canon_arrays(self.directory(group, order, base, start - base), order)

    def canon_note(self, order: str, offset: int) -> None:
        """A Canon maker note that is a TIFF structure of its own (CR3)."""
        self._canon_arrays(self.directory("Canon", order, 0, offset), order)

    def _canon_arrays(self, entries: dict[int, _Entry], order: str) -> None:
        for tag, (group, code) in _CANON_ARRAYS.items():
            if tag in entries and ("Canon", tag) in self.tags:
                entry = entries[tag]
                raw = bytes(self.data[entry.position : entry.position + min(entry.size, MAX_VALUE_BYTES)])
                _spread(self.tags, group, order, code, raw)

    def _nikon(self, entries: dict[int, _Entry]) -> None:
        for tag in (0x0023, 0x00BD):
            if tag in entries:
                entry = entries[tag]
                raw = bytes(self.data[entry.position : entry.position + min(entry.size, MAX_VALUE_BYTES)])
                name, steps, *places = _NIKON_PICTURE_CONTROLS.get(raw[:2], (4, 1))
                self.tags.setdefault(("NikonPc", 4), _text(raw[name : name + 20]))
                self.tags.setdefault(("NikonPc", 0), (steps,))
                for index, place in enumerate(places, 51):
                    if place < len(raw):
                        self.tags.setdefault(("NikonPc", index), (raw[place],))

    def _olympus(self, entries: dict[int, _Entry], order: str, base: int) -> None:
        for tag, group in ((0x2020, "OlympusCs"), (0x2040, "OlympusIp")):
            if tag not in entries:
                continue
            entry = entries[tag]
            offset = (
                struct.unpack_from(order + "I", self.data, entry.position)[0]
                if entry.size == 4
                else entry.position - base
            )
            self.directory(group, order, base, offset)


def _spread(tags: Tags, group: str, order: str, code: str, raw: bytes) -> None:
    """An array tag as one tag for each element."""
    count = len(raw) // struct.calcsize(code)
    for index, value in enumerate(struct.unpack_from(f"{order}{count}{code}", raw)):
        tags.setdefault((group, index), (value,))


def _text(raw: bytes) -> str:
    return raw.split(b"\0", 1)[0].decode("latin-1").strip()


def _from_ciff(data: Buffer) -> Tags:
    order, records = read_ciff(data)
    tags: Tags = {}
    names = [_text(part) for part in records.get(MAKE_AND_MODEL, b"").split(b"\0")]
    if len(names) > 1 and names[0] and names[1]:
        tags["Image", 0x010F], tags["Image", 0x0110] = names[0], names[1]
    _spread(tags, "CanonSi", order, "H", records.get(SHOT_INFO, b""))
    _spread(tags, "CanonCs", order, "H", records.get(CAMERA_SETTINGS, b""))
    return tags


def _from_mrw(data: Buffer) -> Tags:
    """Minolta: blocks of name, length, body; the TTW block is a TIFF structure."""
    position = 8
    end = min(len(data), 8 + struct.unpack_from(">I", data, 4)[0])
    while position + 8 <= end:
        name, length = struct.unpack_from(">4sI", data, position)
        if name == b"\0TTW":
            return read_tiff(bytes(data[position + 8 : position + 8 + length]))
        position += 8 + length
    return {}


def _from_cr3(data: Buffer) -> Tags:
    """Canon CR3: TIFF structures in the boxes CMT1 (image), CMT2 (EXIF), CMT3 (maker note) of moov/uuid."""
    blocks = dict(_boxes(data, 0, len(data), 3, [1000]))
    tags = read_tiff(blocks.get(b"CMT1", b""))
    photo = read_tiff(blocks.get(b"CMT2", b""))
    tags.update({("Photo", tag): value for (group, tag), value in photo.items() if group == "Image"})
    note = blocks.get(b"CMT3", b"")
    order = {b"II": "<", b"MM": ">"}.get(note[:2])
    if order is not None and len(note) >= 8:
        _Reader(note, tags, [MAX_DIRECTORIES]).canon_note(order, struct.unpack_from(order + "I", note, 4)[0])
    return tags


def _boxes(data: Buffer, start: int, end: int, depth: int, budget: list[int]) -> list[tuple[bytes, bytes]]:
    found: list[tuple[bytes, bytes]] = []
    while start + 8 <= end and budget[0] > 0:
        budget[0] -= 1
        size, name = struct.unpack_from(">I4s", data, start)
        body = start + 8
        if size == 1 and start + 16 <= end:
            (size,) = struct.unpack_from(">Q", data, start + 8)
            body = start + 16
        if size < body - start or start + size > end:
            break
        if name in (b"moov", b"uuid") and depth > 0:
            found += _boxes(data, body + (16 if name == b"uuid" else 0), start + size, depth - 1, budget)
        elif name in (b"CMT1", b"CMT2", b"CMT3") and size < 1 << 24:
            found.append((name, bytes(data[body : start + size])))
        start += size
    return found
