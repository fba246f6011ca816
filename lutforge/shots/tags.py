"""The metadata tags of a RAW file or a picture: (group, tag) → integers or text. Groups have the names of exiv2.

Tags are read from TIFF structures; data/maker_notes.json describes the notes of the makers in them. Damaged metadata
raise no error: tags that cannot be read are absent.
"""

import contextlib
import json
import mmap
import re
import struct
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif, read_heif_description
from lutforge.images.jpeg import SOI, read_header
from lutforge.images.packets import packets_of
from lutforge.images.tiff import SIZES, Entry, byte_order, number, offset_in, read_directory
from lutforge.shots.containers import Buffer, ciff_records, tiff_blocks

Value = str | tuple[int, ...]
Key = tuple[str, int]
Tags = dict[Key, Value]

MAKE, MODEL, SOFTWARE = ("Image", 0x010F), ("Image", 0x0110), ("Image", 0x0131)
MAKER_NOTE = ("Photo", 0x927C)
TOOLS = ("Xmp", 0)
"""The programs that XMP names: its CreatorTool, those of its history, and those whose own properties it has."""

_TOOL_NAMES = re.compile(
    rb"""\b[\w.-]{1,40}:(?:CreatorTool|softwareAgent|Software)(?:\s*=\s*["']|\s*>)\s*([^"'<]{1,200})"""
)
"""Any prefix may stand for a namespace: Adobe's programs wrote "xap" for a time, where they write "xmp" now."""
_OWN_PROPERTIES = (
    ("Photoshop", re.compile(rb"\bphotoshop:(?:ColorMode|ICCProfile|History|DocumentAncestors)\b")),
    ("Camera Raw", re.compile(rb"""\bcrs:(?:AlreadyApplied|HasSettings)(?:\s*=\s*["']|\s*>)\s*True""")),
    ("darktable", re.compile(rb"\bdarktable:\w")),
    ("GIMP", re.compile(rb"\bGIMP:\w")),
)
"""Properties that only one program writes. Cameras write others of these namespaces: drones, that there are no settings
of Camera Raw; cameras with names and places for the press, those of Photoshop."""
_MOST_VALUE_BYTES = 8192
"""Bytes of a value that are kept: longer ones are pictures and tables."""
_TIFF_MAGIC = (42, 0x55, 0x4F52, 0x5352)  # TIFF, RW2, ORF, ORF


def tags(path: Path) -> Tags:
    """All tags of a RAW file or a picture, empty where none can be read. Raises nothing of its own."""
    result: Tags = {}
    with (
        contextlib.suppress(ImageError),
        reading(path, "a picture", ImageError),
        path.open("rb") as file,
        mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data,
    ):
        if is_heif(path):
            described = read_heif_description(path)
            result = tags_of(described.exif) | _tools_of(described.xmp)
        else:
            result = tags_of(data)
    return result


def tags_of(data: Buffer) -> Tags:
    """The tags of a file's bytes; a memory map will do."""
    result: Tags = {}
    with contextlib.suppress(ImageError), reading("", "metadata", ImageError):
        if byte_order(data[:2]) and data[6:14] == b"HEAPCCDR":
            return _ciff_tags(data)
        for block, group in tiff_blocks(data):
            _Structure(block, result).read(group)
        result |= _tools_of(packets_of(data).xmp)
        if bytes(data[:2]) == SOI and (header := read_header(data)) is not None:
            # A JPEG that LutForge graded has its source's EXIF, and its settings now in a comment.
            for comment in header.comments:
                if comment.startswith("LutForge"):
                    result[SOFTWARE] = comment.partition("\n")[0]
    return result


def _tools_of(xmp: bytes) -> Tags:
    """The programs that a packet of XMP names, as one tag; none where it names none."""
    names = [text.decode("utf-8", "replace") for text in _TOOL_NAMES.findall(xmp)[:200]]
    names += [name for name, properties in _OWN_PROPERTIES if properties.search(xmp)]
    return {TOOLS: " ".join(names)} if names else {}


@cache
def maker_table(name: str) -> Any:
    """One of the JSON files of this package, with the meaning of the makers' tags."""
    return json.loads(resources.files(__package__).joinpath("data", f"{name}.json").read_text(encoding="utf-8"))


@cache
def key_of(text: str) -> Key:
    """The key of a tag as the tables write it: "CanonCs:0x000d"."""
    group, _, number = text.partition(":")
    return group, int(number, 16)


def element(value: Value | None, index: int) -> int | None:
    """One of the numbers of a tag; None where it has no such number."""
    return value[index] if isinstance(value, tuple) and len(value) > index else None


def spread(result: Tags, group: str, order: str, size: int, raw: bytes) -> None:
    """Add an array of numbers of 2 or 4 bytes as one tag for each element."""
    numbers = np.frombuffer(raw[: len(raw) // size * size], f"{order}u{size}")
    for index, value in enumerate(numbers.tolist()):
        result.setdefault((group, index), (value,))


def text_of(raw: bytes) -> str:
    """Text up to its first null."""
    return raw.split(b"\0", 1)[0].decode("latin-1").strip()


class _Structure:
    """A block of bytes that holds a TIFF structure, and the tags found in it so far."""

    def __init__(self, data: Buffer, tags: Tags) -> None:
        self.data, self.tags = data, tags

    def read(self, group: str) -> None:
        """First directory, EXIF directory and maker note (in a DNG file also its private data)."""
        order = byte_order(self.data[:2])
        if order is None or self.number(order, "H", 2) not in _TIFF_MAGIC:
            return
        entries = self.directory(group, order, 0, self.number(order, "I", 4))
        if group == "Canon":
            self.arrays(entries, order)
        pointer, private = offset_in(self.data, order, entries, 0x8769), entries.get(0xC634)
        if pointer is not None:
            photo = self.directory("Photo", order, 0, pointer)
            note, interoperability = photo.get(0x927C), offset_in(self.data, order, photo, 0xA005)
            if note is not None:
                self.maker_note(order, note.place.start, 0)
            if interoperability is not None:
                self.directory("Iop", order, 0, interoperability)
        if private is not None:
            self.private_data(order, private.place.start, 0)

    def number(self, order: str, code: str, at: int) -> int:
        return number(self.data, order, code, at)

    def directory(self, group: str, order: str, base: int, offset: int) -> dict[int, Entry]:
        """Add the tags of one directory at base + offset, and return its fields."""
        entries: dict[int, Entry] = {}
        with contextlib.suppress(struct.error):
            entries, _ = read_directory(self.data, order, offset, base)
        for tag, entry in entries.items():
            raw = self.raw(entry)
            value: Value = ()  # of floating-point numbers
            if entry.kind == 2:
                value = text_of(raw)
            elif entry.kind not in (11, 12):
                size = {5: 4, 10: 4}.get(entry.kind, SIZES[entry.kind])  # a ratio is two numbers
                dtype = f"{order}{'i' if entry.kind in (6, 8, 9, 10) else 'u'}{size}"
                value = tuple(np.frombuffer(raw[: len(raw) // size * size], dtype).tolist())
            self.tags.setdefault((group, tag), value)
        return entries

    def raw(self, entry: Entry) -> bytes:
        return bytes(self.data[entry.place][:_MOST_VALUE_BYTES])

    def maker_note(self, order: str, start: int, base: int) -> None:
        """Read a maker's note at `start` as data/maker_notes.json says, with offsets from `base` where it says none."""
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

    def arrays(self, entries: dict[int, Entry], order: str) -> None:
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

    def subdirectories(self, parent: str, entries: dict[int, Entry], order: str, base: int) -> None:
        for text, group in maker_table("maker_notes")["directories"]["tags"].items():
            entry = entries.get(key_of(text)[1])
            if entry is not None and key_of(text)[0] == parent:
                start, size = entry.place.start, entry.place.stop - entry.place.start
                self.directory(group, order, base, self.number(order, "I", start) if size == 4 else start - base)


def _ciff_tags(data: Buffer) -> Tags:
    """The tags of a CIFF file, whose Canon records are those of Canon's later maker notes."""
    records = ciff_records(data)
    order = "<" if data[:2] == b"II" else ">"
    result: Tags = {}
    names = [text_of(part) for part in records.get(0x080A, b"").split(b"\0")]  # make and model
    if len(names) > 1 and names[0] and names[1]:
        result[MAKE], result[MODEL] = names[0], names[1]
    spread(result, "CanonSi", order, 2, records.get(0x102A, b""))
    spread(result, "CanonCs", order, 2, records.get(0x102D, b""))
    return result
