"""What a RAW file or a picture says of itself: (group, tag) → integers or text. Groups are named as exiv2 names them.

exifread finds and walks the directories (TIFF-like RAW files, JPEG, HEIC, PNG, WebP, JPEG XL); where the makers' notes
lie in them says data/maker_notes.json. Files that exifread does not know are opened by `containers`. exiv2 completes
the tags where it is installed; exiftool, where it is, is asked for notes that nobody else reads.
Damaged metadata raise nothing: what cannot be read is not there.
"""

import contextlib
import json
import logging
import mmap
import re
import shutil
import struct
import subprocess
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from exifread.core.exif_header import ExifHeader
from exifread.core.find_exif import determine_type
from exifread.tags.fields import FIELD_DEFINITIONS

from lutforge import child_processes
from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif, read_heif_exif
from lutforge.images.jpeg import SOI, read_header
from lutforge.shots.containers import Buffer, Handle, is_ciff, read_ciff, tiff_blocks

Value = str | tuple[int, ...]
Key = tuple[str, int]
Tags = dict[Key, Value]

MAKE, MODEL, SOFTWARE = ("Image", 0x010F), ("Image", 0x0110), ("Image", 0x0131)
MAKER_NOTE = ("Photo", 0x927C)

_LARGEST = 8192
"""Bytes of a value that are kept: longer ones are pictures and tables."""
_TIFF_MAGIC = (42, 0x55, 0x4F52, 0x5352)  # TIFF, RW2, ORF, ORF

logging.getLogger("exifread").addHandler(logging.NullHandler())
logging.getLogger("exifread").propagate = False


def tags(path: Path) -> Tags:
    """All tags of a RAW file or a picture, empty where none can be read. Raises nothing of its own."""
    found: Tags = {}
    with (
        contextlib.suppress(ImageError),
        reading(path, "a picture", ImageError),
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
    ):
        found = tags_of(read_heif_exif(path) if is_heif(path) else data)
    found = {**_exiv2_tags(path), **found}
    if MAKER_NOTE in found and {group for group, _ in found} <= {"Image", "Photo", "Iop"}:
        found = {**_exiftool_tags(path), **found}
    return found


def tags_of(data: Buffer) -> Tags:
    """The tags of a file's bytes; a memory map will do."""
    found: Tags = {}
    with contextlib.suppress(ImageError), reading("", "metadata", ImageError):
        if is_ciff(bytes(data[:14])):
            return _ciff_tags(data)
        for block, group in tiff_blocks(data):
            _Structure(block, found).read(group)
        if bytes(data[:2]) == SOI and (header := read_header(data)) is not None:
            # A JPEG that LutForge graded has its source's EXIF, and tells in a comment what it is now.
            for comment in header.comments:
                if comment.startswith("LutForge"):
                    found[SOFTWARE] = comment.partition("\n")[0]
    return found


@cache
def maker_table(name: str) -> Any:
    """One of the JSON files beside this module that say what the makers' tags mean."""
    return json.loads(resources.files(__package__).joinpath("data", f"{name}.json").read_text(encoding="utf-8"))


@cache
def key_of(text: str) -> Key:
    """The key of a tag as the tables write it: "CanonCs:0x000d"."""
    group, _, number = text.partition(":")
    return group, int(number, 16)


def spread(found: Tags, group: str, order: str, size: int, raw: bytes) -> None:
    """Add an array of numbers of 2 or 4 bytes as one tag for each element."""
    numbers = np.frombuffer(raw[: len(raw) // size * size], f"{order}u{size}")
    for index, value in enumerate(numbers.tolist()):
        found.setdefault((group, index), (value,))


def text_of(raw: bytes) -> str:
    """Text up to its first null."""
    return raw.split(b"\0", 1)[0].decode("latin-1").strip()


@dataclass(frozen=True)
class _Entry:
    """Where a directory entry's value lies in the block."""

    position: int
    size: int


@dataclass
class _Structure:
    """A block of bytes that holds a TIFF structure, and the tags found in it so far."""

    data: Buffer
    tags: Tags
    handle: Any = field(init=False)

    def __post_init__(self) -> None:
        self.handle = Handle(self.data)

    def read(self, group: str) -> None:
        """First directory, EXIF directory and maker note (in a DNG file also its private data)."""
        base, first_byte, _ = determine_type(self.handle)
        order = {b"I": "<", b"M": ">"}.get(bytes(first_byte[:1]))
        if order is None or self.number(order, "H", base + 2) not in _TIFF_MAGIC:
            return
        entries = self.directory(group, order, base, self.number(order, "I", base + 4))
        if group == "Canon":
            self.arrays(entries, order)
        pointer, private = entries.get(0x8769), entries.get(0xC634)
        if pointer is not None:
            photo = self.directory("Photo", order, base, self.number(order, "I", pointer.position))
            note, interoperability = photo.get(0x927C), photo.get(0xA005)
            if note is not None:
                self.maker_note(order, note.position, base)
            if interoperability is not None:
                self.directory("Iop", order, base, self.number(order, "I", interoperability.position))
        if private is not None:
            self.private_data(order, private.position, base)

    def number(self, order: str, code: str, position: int) -> int:
        return int(struct.unpack_from(order + code, self.data, position)[0])

    def directory(self, group: str, order: str, base: int, offset: int) -> dict[int, _Entry]:
        """Add the tags of one directory at base + offset; their values' places."""
        header = ExifHeader(self.handle, "I" if order == "<" else "M", base, 0, strict=False)
        with contextlib.suppress(Exception):  # exifread raises what it likes; what it had read until then stays
            header.dump_ifd(offset, group, tag_dict={})
        found: dict[int, _Entry] = {}
        for entry in header.tags.values():
            place = _Entry(base + entry.field_offset, entry.field_length)
            if place.position >= 0 and place.position + place.size <= len(self.data):
                found.setdefault(entry.tag, place)
                self.tags.setdefault((group, entry.tag), self._value(entry, order, place))
        return found

    def raw(self, place: _Entry) -> bytes:
        return bytes(self.data[place.position : place.position + min(place.size, _LARGEST)])

    def _value(self, entry: Any, order: str, place: _Entry) -> Value:
        if isinstance(entry.values, str | bytes):
            return text_of(self.raw(place))
        if not entry.values:  # exifread leaves out long ones
            size = FIELD_DEFINITIONS[entry.field_type][0]
            raw = self.raw(place)
            return tuple(np.frombuffer(raw[: len(raw) // size * size], f"{order}u{size}").tolist())
        numbers: list[int] = []
        for value in entry.values:
            if not isinstance(value, tuple):  # floating-point numbers
                numbers += [value] if isinstance(value, int) else [value.num, value.den]
        return tuple(numbers)

    def maker_note(self, order: str, start: int, base: int) -> None:
        """Read a maker's note at `start` as data/maker_notes.json says.

        Offsets count from `base`, where it says no other.
        """
        head = bytes(self.data[start : start + 20])
        make = str(self.tags.get(MAKE, "")).lower()
        for row in maker_table("maker_notes")["notes"]:
            signature, tiff = row.get("starts", "").encode("latin-1"), row.get("tiff_at")
            if not head.startswith(signature) or not make.startswith(row.get("make", "")):
                continue
            if tiff is not None:
                if head[tiff : tiff + 2] not in (b"II", b"MM"):
                    continue
                order, base = "<" if head[tiff : tiff + 2] == b"II" else ">", start + tiff
                offset = self.number(order, "I", base + 4)
            else:
                base = start if row.get("relative") else base
                stated = head[row["order_at"] :][:2] if "order_at" in row else row.get("order", "").encode()
                order = {b"II": "<", b"MM": ">"}.get(stated, order)
                offset = self.number(order, "I", start + row["pointer"]) if "pointer" in row else row["ifd"]
                offset += start - base
                if "order_at" in row and self.number(order, "H", base + offset) >= 256:
                    # No directory has that many entries: programs that rewrite a file in the other byte order leave
                    # the note as it was, or change only what states it.
                    order = {"<": ">", ">": "<"}[order]
            entries = self.directory(row["group"], order, base, offset)
            self.arrays(entries, order)
            self.subdirectories(row["group"], entries, order, base)
            return

    def private_data(self, order: str, start: int, base: int) -> None:
        """Read DNGPrivateData: a maker note as a camera wrote it, or as Adobe's converter moved it there.

        Adobe's is "Adobe", block "MakN", its length, byte order, the note's offset in the old file, the note.
        """
        head = bytes(self.data[start : start + 20])
        if head[:10] == b"Adobe\0MakN" and head[14:16] in (b"II", b"MM"):
            moved = start + 20 - self.number(">", "I", start + 16)
            self.maker_note("<" if head[14:16] == b"II" else ">", start + 20, moved)
        elif head[:4] == b"AOC\0" or head[:8] == b"PENTAX \0":
            self.maker_note(order, start, base)

    def arrays(self, entries: dict[int, _Entry], order: str) -> None:
        """Add each element of Canon's arrays, and Nikon's picture control, as tags of their own."""
        table = maker_table("maker_notes")
        for text, (group, size) in table["arrays"]["tags"].items():
            if ("Canon", key_of(text)[1]) in self.tags and key_of(text)[1] in entries:
                spread(self.tags, group, order, size, self.raw(entries[key_of(text)[1]]))
        for tag in (0x0023, 0x00BD):
            if tag in entries and ("Nikon", tag) in self.tags:
                raw = self.raw(entries[tag])
                versions = table["nikon_picture_controls"]["versions"]
                name, steps, *places = versions.get(raw[:2].decode("latin-1"), (4, 1))
                self.tags.setdefault(("NikonPc", 4), text_of(raw[name : name + 20]))
                self.tags.setdefault(("NikonPc", 0), (steps,))
                for index, place in enumerate(places, 51):
                    if place < len(raw):
                        self.tags.setdefault(("NikonPc", index), (raw[place],))

    def subdirectories(self, parent: str, entries: dict[int, _Entry], order: str, base: int) -> None:
        for text, group in maker_table("maker_notes")["directories"]["tags"].items():
            entry = entries.get(key_of(text)[1])
            if entry is not None and key_of(text)[0] == parent:
                points = entry.size == 4
                self.directory(
                    group, order, base, self.number(order, "I", entry.position) if points else entry.position - base
                )


def _ciff_tags(data: Buffer) -> Tags:
    order, records = read_ciff(data)
    found: Tags = {}
    names = [text_of(part) for part in records.get(0x080A, b"").split(b"\0")]  # make and model
    if len(names) > 1 and names[0] and names[1]:
        found[MAKE], found[MODEL] = names[0], names[1]
    spread(found, "CanonSi", order, 2, records.get(0x102A, b""))
    spread(found, "CanonCs", order, 2, records.get(0x102D, b""))
    return found


def _exiv2_tags(path: Path) -> Tags:
    """Tags as the optional exiv2 package reads them; none where it is missing or fails."""
    try:
        import exiv2
    except ImportError:
        return {}
    found: Tags = {}
    with contextlib.suppress(Exception):  # exiv2.Exiv2Error exists only where the package does
        exiv2.LogMsg.setLevel(exiv2.LogMsg.Level.mute)
        image = exiv2.ImageFactory.open(str(path))
        image.readMetadata()
        for datum in image.exifData():
            group = re.sub(r"^(Nikon|Sony)\d$", r"\1", datum.groupName())
            if datum.size() <= _LARGEST:
                found.setdefault((group, int(datum.tag())), _parsed(datum.toString()))
    return found


def _exiftool_tags(path: Path) -> Tags:
    """Tags as exiftool reads them, where it is installed: numbers as they are stored, as far as it gives them."""
    program = shutil.which("exiftool")
    if program is None:
        return {}
    found: Tags = {}
    groups = maker_table("maker_notes")["exiftool_tables"]
    with contextlib.suppress(OSError, subprocess.SubprocessError, ValueError, LookupError, AttributeError):
        command = [program, "-j", "-n", "-t", "-D", "-fast", str(path.absolute())]
        printed = child_processes.run(command, 20).stdout
        for entry in json.loads(printed)[0].values():
            if isinstance(entry, dict) and entry["table"] in groups and str(entry["id"]).isdecimal():
                found.setdefault((groups[entry["table"]], int(entry["id"])), _parsed(str(entry["val"])))
    return found


def _parsed(text: str) -> Value:
    """Another reader's text of a value: integers (ratios as two) or text."""
    parts = text.replace("/", " ").split()
    if parts and all(re.fullmatch(r"-?\d{1,19}", part) for part in parts):
        return tuple(int(part) for part in parts)
    return text.strip()[:_LARGEST]
