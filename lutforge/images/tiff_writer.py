"""Directories and fields of TIFF files (TIFF 6.0), written for DNG files and DNG camera profiles."""

import struct
from collections.abc import Iterable, Mapping
from fractions import Fraction

import numpy as np
from numpy.typing import ArrayLike

Field = tuple[int, int, bytes]
"""Type, count and packed values of one field."""


class TiffWriter:
    """A little-endian file that is built block by block. magic: the number after the byte order, which is its kind."""

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
    """ASCII text with a closing zero; other characters become "?"."""
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
    """Ratios of two numbers of 32 bits, exact to six decimals or better."""
    pairs = [Fraction(float(value)).limit_denominator(1_000_000) for value in values]
    numbers = [number for pair in pairs for number in pair.as_integer_ratio()]
    return 10 if signed else 5, len(pairs), struct.pack(f"<{len(numbers)}{'i' if signed else 'I'}", *numbers)
