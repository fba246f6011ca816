"""Directories and fields of TIFF structures (TIFF 6.0), read from TIFF files, EXIF, DNG and DNG camera profiles."""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from mmap import mmap

SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
"""Bytes of a value of each type."""


@dataclass(frozen=True)
class Entry:
    """An entry of a directory: the type of its values (of SIZES), and their place in the block."""

    kind: int
    place: slice


def byte_order(head: bytes) -> str | None:
    """The byte order that the first bytes of a TIFF structure state, as `struct` writes it; None for other bytes."""
    return {b"II": "<", b"MM": ">"}.get(head[:2])


def number(block: bytes | mmap, order: str, code: str, at: int) -> int:
    """The number at an offset, of `struct`'s type `code`. Raises struct.error outside the block."""
    return int(struct.unpack_from(order + code, block, at)[0])


def read_directory(block: bytes | mmap, order: str, offset: int, base: int = 0) -> tuple[dict[int, Entry], int]:
    """The fields of a directory by tag, and the offset of the next directory, 0 for none.

    offset: of the directory; it and the offsets in it count from `base`. Of repeated fields the first counts. Fields
    outside the block are left out, and all after 512. Raises struct.error where the directory begins outside the block.
    """
    start = base + offset
    if start < 0:
        raise struct.error("a directory before its file")
    end = start + 2 + 12 * number(block, order, "H", start)
    entries: dict[int, Entry] = {}
    for at in range(start + 2, min(end, start + 2 + 12 * 512, len(block) - 11), 12):
        tag, kind, count, value = struct.unpack_from(f"{order}HHII", block, at)
        size = SIZES.get(kind, 0) * count
        first = at + 8 if size <= 4 else base + value
        if kind in SIZES and 0 <= first <= len(block) - size:
            entries.setdefault(tag, Entry(kind, slice(first, first + size)))
    return entries, number(block, order, "I", end) if end + 4 <= len(block) else 0


def offset_in(block: bytes | mmap, order: str, entries: Mapping[int, Entry], tag: int) -> int | None:
    """The offset that a field states; None where the directory has no such field."""
    return number(block, order, "I", entries[tag].place.start) if tag in entries else None
