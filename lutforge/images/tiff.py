"""TIFF files and their kin (EXIF, DNG, DNG camera profiles): directories and fields, read and written (TIFF 6.0)."""

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from mmap import mmap

import numpy as np
from numpy.typing import ArrayLike

Field = tuple[int, int, bytes]
"""Type, count and packed values of one field."""


class TiffWriter:
    """Collects the blocks of a little-endian file. magic: the number behind the byte order, which tells its kind."""

    def __init__(self, magic: int = 42) -> None:
        self._content = bytearray(struct.pack("<2sHI", b"II", magic, 0))

    def append(self, block: bytes) -> int:
        """Add a block on an even offset and return the offset."""
        self._content += b"\0" * (len(self._content) % 2)
        offset = len(self._content)
        self._content += block
        return offset

    def directory(self, fields: Mapping[int, Field]) -> int:
        """Add an image file directory, tags in rising order, and return its offset."""
        entries = bytearray(struct.pack("<H", len(fields)))
        for tag, (kind, count, values) in sorted(fields.items()):
            inline = values.ljust(4, b"\0") if len(values) <= 4 else struct.pack("<I", self.append(values))
            entries += struct.pack("<HHI", tag, kind, count) + inline
        return self.append(bytes(entries + struct.pack("<I", 0)))

    def finish(self, first_directory: int) -> bytes:
        """Return the whole file, whose header points to its first directory."""
        struct.pack_into("<I", self._content, 4, first_directory)
        return bytes(self._content)


def byte_field(*values: int) -> Field:
    """Unsigned numbers of 8 bits."""
    return 1, len(values), bytes(values)


def text_field(text: str) -> Field:
    """ASCII, what is not becomes "?", with the closing zero."""
    values = text.encode("ascii", "replace") + b"\0"
    return 2, len(values), values


def short_field(*values: int) -> Field:
    """Unsigned numbers of 16 bits."""
    return 3, len(values), struct.pack(f"<{len(values)}H", *values)


def long_field(*values: int) -> Field:
    """Unsigned numbers of 32 bits."""
    return 4, len(values), struct.pack(f"<{len(values)}I", *values)


def float_field(values: ArrayLike) -> Field:
    """Floating-point numbers of 32 bits, of an array of any shape."""
    flat = np.ascontiguousarray(values, dtype="<f4").ravel()
    return 11, flat.size, flat.tobytes()


def rational_field(values: Iterable[float], signed: bool = False) -> Field:
    """Ratios of two numbers of 32 bits, right to six decimals or better."""
    pairs = [Fraction(float(value)).limit_denominator(1_000_000) for value in values]
    numbers = [number for pair in pairs for number in pair.as_integer_ratio()]
    return 10 if signed else 5, len(pairs), struct.pack(f"<{len(numbers)}{'i' if signed else 'I'}", *numbers)


# --- Reading ---------------------------------------------------------------------------------------------------------


SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
"""Bytes of a value of each type."""


@dataclass(frozen=True)
class Entry:
    """A field as a directory has it: its type (of SIZES), and where its values stand in the block."""

    kind: int
    place: slice


def byte_order(head: bytes) -> str | None:
    """The byte order that the first bytes of a structure state, as `struct` writes it; None for no structure."""
    return {b"II": "<", b"MM": ">"}.get(head[:2])


def number(block: bytes | mmap, order: str, code: str, at: int) -> int:
    """The number at a place, of `struct`'s kind `code`. Raises struct.error outside the block."""
    return int(struct.unpack_from(order + code, block, at)[0])


def read_directory(block: bytes | mmap, order: str, offset: int, base: int = 0) -> tuple[dict[int, Entry], int]:
    """The fields of a directory by tag, and the offset of the next directory, 0 for none.

    offset: counts from `base`, as those do that the directory holds. A field counts once; what does not lie in the
    block is left out, and what follows 512 fields. Raises struct.error where the directory begins outside of the block.
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
