"""What stands in front of a JPEG's pixels: size, quantization tables, and every metadata segment byte for byte."""

import struct
from dataclasses import dataclass
from enum import IntEnum
from mmap import mmap

SOI, EOI = b"\xff\xd8", b"\xff\xd9"
ICC = b"ICC_PROFILE\0"

_ZIGZAG = sorted(range(64), key=lambda at: (at // 8 + at % 8, at // 8 if (at // 8 + at % 8) % 2 else at % 8))
"""Place in the 8 × 8 table of each entry as a file stores it (ITU-T T.81, figure A.6)."""


class Marker(IntEnum):
    """Second bytes of the markers of metadata segments (ITU-T T.81, table B.1). EXIF stands in APP1."""

    COMMENT = 0xFE
    APP0 = 0xE0
    EXIF = 0xE1
    APP2 = 0xE2
    APP15 = 0xEF


@dataclass(frozen=True)
class Segment:
    """A metadata segment. marker: its second byte, APP0 … APP15 or COM; body: without marker and length."""

    marker: int
    body: bytes

    @property
    def stored(self) -> bytes:
        """The segment as it stands in a file."""
        return b"\xff" + bytes([self.marker]) + struct.pack(">H", len(self.body) + 2) + self.body

    @property
    def is_exif(self) -> bool:
        """Whether it holds EXIF."""
        return self.marker == Marker.EXIF and self.body.startswith(PREFIX)

    @property
    def is_icc(self) -> bool:
        """Whether it holds a piece of an ICC profile (ICC.1:2022, B.4)."""
        return self.marker == Marker.APP2 and self.body.startswith(ICC)

    @property
    def is_adobe(self) -> bool:
        """Whether it tells how colours are coded (libjpeg.txt, "Special markers")."""
        return self.marker == 0xEE and len(self.body) >= 12 and self.body.startswith(b"Adobe")

    @property
    def tells_previews(self) -> bool:
        """Whether it says where further pictures begin (Multi-Picture Format, CIPA DC-007)."""
        return self.marker == Marker.APP2 and self.body.startswith(b"MPF\0")


@dataclass(frozen=True)
class JpegHeader:
    """What stands in front of a JPEG's pixels.

    segments: the metadata, in the file's order. tables: 64 quantization steps for each component, row by row; sampling:
    horizontal and vertical factors for each. plain: 8-bit YCbCr, Huffman-coded, as cameras write.
    """

    width: int
    height: int
    segments: tuple[Segment, ...]
    tables: tuple[tuple[int, ...], ...]
    sampling: tuple[tuple[int, int], ...]
    plain: bool

    @property
    def exif(self) -> bytes | None:
        """The TIFF structure of the EXIF segment; None where there is none."""
        found = (segment.body for segment in self.segments if segment.is_exif)
        return next((body[len(PREFIX) :] for body in found), None)

    @property
    def says_adobe_rgb(self) -> bool:
        """True where EXIF says that the picture is in Adobe RGB, as DCF 2.0 has it."""
        block = self.exif or b""
        places = exif_places(block)
        return places is not None and places.interoperability is not None and block[places.interoperability] == b"R03"

    @property
    def comments(self) -> tuple[str, ...]:
        """The text of the comment segments."""
        bodies = [segment.body for segment in self.segments if segment.marker == Marker.COMMENT]
        return tuple(body.rstrip(b"\0").decode("utf-8", "replace") for body in bodies)

    @property
    def icc(self) -> bytes:
        """The ICC profile, of all segments that hold a piece of it; empty where there is none."""
        pieces = [segment.body for segment in self.segments if segment.is_icc]
        return b"".join(piece[len(ICC) + 2 :] for piece in sorted(pieces, key=lambda piece: piece[len(ICC)]))

    @property
    def has_previews(self) -> bool:
        """True where further pictures follow the first."""
        return any(segment.tells_previews for segment in self.segments)

    @property
    def has_gain_map(self) -> bool:
        """True where a gain map for HDR displays follows: Ultra HDR 1.1 says so in XMP, ISO 21496-1 in a segment."""
        told = (b"ns.adobe.com/hdr-gain-map", b"urn:iso:std:iso:ts:21496:-1")
        return any(
            segment.marker in (Marker.EXIF, Marker.APP2) and any(word in segment.body for word in told)
            for segment in self.segments
        )


def read_header(data: bytes | mmap) -> JpegHeader | None:
    """Read what stands in front of the pixels; None for what is no JPEG, or a damaged one."""
    segments: list[Segment] = []
    tables: dict[int, tuple[int, ...]] = {}
    frame, kind, at = b"", 0, 2
    while data[:2] == SOI and at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker == 0xFF:  # a fill byte
            at += 1
            continue
        body = data[at + 4 : at + 2 + int.from_bytes(data[at + 2 : at + 4], "big")]
        if Marker.APP0 <= marker <= Marker.APP15 or marker == Marker.COMMENT:
            segments.append(Segment(marker, body))
        elif marker == 0xDB:
            tables |= _tables(body)
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            frame, kind = body, marker
        elif marker == 0xDA:
            return _header(frame, kind, tables, tuple(segments))
        at += 4 + len(body)
    return None


def metadata_end(data: bytes) -> int:
    """Return the offset of the first byte after SOI and the metadata segments that follow it."""
    at = 2
    while data[at : at + 1] == b"\xff" and (
        Marker.APP0 <= data[at + 1] <= Marker.APP15 or data[at + 1] == Marker.COMMENT
    ):
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return at


def _tables(body: bytes) -> dict[int, tuple[int, ...]]:
    found, at = {}, 0
    while at < len(body):
        wide = body[at] >> 4
        steps = struct.unpack_from(">64H" if wide else "64B", body.ljust(at + 130, b"\1"), at + 1)
        placed = dict(zip(_ZIGZAG, steps, strict=True))
        found[body[at] & 15] = tuple(placed[index] for index in range(64))
        at += 129 if wide else 65
    return found


def _header(
    frame: bytes, kind: int, tables: dict[int, tuple[int, ...]], segments: tuple[Segment, ...]
) -> JpegHeader | None:
    if len(frame) < 6 or len(frame) < 6 + 3 * frame[5]:
        return None
    components = [frame[6 + 3 * index : 9 + 3 * index] for index in range(frame[5])]
    if not all(selector in tables for _, _, selector in components):
        return None
    height, width = struct.unpack_from(">HH", frame, 1)
    transform = [segment.body[11] for segment in segments if segment.is_adobe]
    named_rgb = [name for name, _, _ in components] == list(b"RGB")
    return JpegHeader(
        width,
        height,
        segments,
        tuple(tables[selector] for _, _, selector in components),
        tuple((factors >> 4, factors & 15) for _, factors, _ in components),
        plain=kind in (0xC0, 0xC1, 0xC2) and frame[0] == 8 and len(components) == 3
        and (transform[-1] == 1 if transform else not named_rgb),
    )  # fmt: skip


# --- Places in an EXIF block, so that a value can be changed where it stands -----------------------------------------


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
    start, end = at + 2, at + 2 + 12 * count
    entries = {int(struct.unpack_from(f"{order}H", block, entry)[0]): entry + 8 for entry in range(start, end, 12)}
    return entries, _number(block, order, end) if end + 4 <= len(block) else 0
