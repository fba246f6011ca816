"""Places in an EXIF block, so that a value can be changed where it stands and every other byte stays."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

PREFIX = b"Exif\0\0"
"""Beginning of an APP1 segment that holds EXIF; the TIFF structure follows."""


class _Tag(IntEnum):
    """Tags of Exif 2.32: 4.5.4, 4.6.3, 4.6.5 and 4.6.7; the last is of the interoperability directory."""

    EXIF_DIRECTORY = 0x8769
    INTEROPERABILITY_DIRECTORY = 0xA005
    COLOUR_SPACE = 0xA001
    THUMBNAIL = 0x0201
    THUMBNAIL_LENGTH = 0x0202
    INTEROPERABILITY = 0x0001


@dataclass(frozen=True)
class ExifPlaces:
    """Where values stand in a TIFF structure.

    order: of bytes, as `struct` writes it. thumbnail: the JPEG of the second directory; colour_space: two bytes;
    interoperability: three, "R98" for sRGB and "R03" for Adobe RGB (DCF 2.0); None where there is none.
    """

    order: str
    thumbnail: slice | None = None
    colour_space: slice | None = None
    interoperability: slice | None = None


def exif_places(block: bytes) -> ExifPlaces | None:
    """Find the places in a TIFF structure, which begins with its byte order; None where it is damaged."""
    order = {b"II*\0": "<", b"MM\0*": ">"}.get(block[:4])
    if order is None:
        return None
    try:
        first, second = _directory(block, order, _number(block, order, 4))
        photo: dict[int, int] = {}
        colours: dict[int, int] = {}
        if _Tag.EXIF_DIRECTORY in first:
            photo, _ = _directory(block, order, _number(block, order, first[_Tag.EXIF_DIRECTORY]))
        if _Tag.INTEROPERABILITY_DIRECTORY in photo:
            colours, _ = _directory(block, order, _number(block, order, photo[_Tag.INTEROPERABILITY_DIRECTORY]))
        pictures, _ = _directory(block, order, second) if second else ({}, 0)
        thumbnail = None
        if _Tag.THUMBNAIL in pictures and _Tag.THUMBNAIL_LENGTH in pictures:
            start = _number(block, order, pictures[_Tag.THUMBNAIL])
            thumbnail = slice(start, start + _number(block, order, pictures[_Tag.THUMBNAIL_LENGTH]))
            if not 0 < start < thumbnail.stop <= len(block):
                thumbnail = None
    except struct.error:  # an offset beyond the end
        return None
    return ExifPlaces(order, thumbnail, _field(photo, _Tag.COLOUR_SPACE, 2), _field(colours, _Tag.INTEROPERABILITY, 3))


def _field(directory: dict[int, int], tag: int, size: int) -> slice | None:
    at = directory.get(tag)
    return None if at is None else slice(at, at + size)


def _number(block: bytes, order: str, at: int) -> int:
    return int(struct.unpack_from(f"{order}I", block, at)[0])


def _directory(block: bytes, order: str, at: int) -> tuple[dict[int, int], int]:
    """Return the offset of the value field of each tag of a directory, and of the next directory (0: none)."""
    (count,) = struct.unpack_from(f"{order}H", block, at)
    entries = dict(_entries(block, order, at + 2, count))
    end = at + 2 + 12 * count
    return entries, _number(block, order, end) if end + 4 <= len(block) else 0


def _entries(block: bytes, order: str, at: int, count: int) -> Iterator[tuple[int, int]]:
    for entry in range(at, at + 12 * count, 12):
        yield int(struct.unpack_from(f"{order}H", block, entry)[0]), entry + 8
