"""The header of a JPEG file: its metadata segments, byte for byte, and how its pixels are coded."""

import struct
from dataclasses import dataclass
from io import BytesIO
from mmap import mmap

from PIL.JpegImagePlugin import JpegImageFile

from lutforge.images.exif_places import exif_places

SOI, EOI = b"\xff\xd8", b"\xff\xd9"

COMMENT, APP0, APP1, APP2, APP15 = 0xFE, 0xE0, 0xE1, 0xE2, 0xEF
"""Second bytes of the markers of metadata segments (ITU-T T.81, table B.1)."""

# The marker and the first bytes of some kinds of segments:
EXIF = (APP1, b"Exif\0\0")
"""A TIFF structure."""
ICC = (APP2, b"ICC_PROFILE\0")
"""A piece of an ICC profile (ICC.1:2022, B.4)."""
PREVIEWS = (APP2, b"MPF\0")
"""The index of further pictures in the file (Multi-Picture Format, CIPA DC-007)."""
ADOBE = (0xEE, b"Adobe")
"""Adobe's segment, which states how colours are coded (libjpeg.txt)."""


@dataclass(frozen=True)
class Segment:
    """A metadata segment. marker: its second byte, APP0 … APP15 or COM; body: without marker and length."""

    marker: int
    body: bytes

    @property
    def stored(self) -> bytes:
        """The bytes of the segment in a file."""
        return b"\xff" + bytes([self.marker]) + struct.pack(">H", len(self.body) + 2) + self.body

    def holds(self, kind: tuple[int, bytes]) -> bool:
        """True where it is of a kind such as EXIF."""
        return self.marker == kind[0] and self.body.startswith(kind[1])


@dataclass(frozen=True)
class JpegHeader:
    """The part of a JPEG file before its pixels.

    segments: the metadata, in the file's order. tables: 64 quantization steps for each component, row by row; sampling:
    horizontal and vertical factors for each. plain: three components, YCbCr, as cameras write.
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
        return next((segment.body[len(EXIF[1]) :] for segment in self.segments if segment.holds(EXIF)), None)

    @property
    def is_adobe_rgb(self) -> bool:
        """True where EXIF states that the picture is in Adobe RGB, by DCF 2.0."""
        block = self.exif or b""
        return block[exif_places(block).get("interoperability", slice(0))] == b"R03"

    @property
    def comments(self) -> tuple[str, ...]:
        """The text of the comment segments."""
        bodies = [segment.body for segment in self.segments if segment.marker == COMMENT]
        return tuple(body.rstrip(b"\0").decode("utf-8", "replace") for body in bodies)

    @property
    def icc(self) -> bytes:
        """The ICC profile, joined from its segments; empty where there is none."""
        pieces = [segment.body[len(ICC[1]) :] for segment in self.segments if segment.holds(ICC)]
        return b"".join(piece[2:] for piece in sorted(pieces, key=lambda piece: piece[:1]))

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on the parts that a graded file does not get.

        Ultra HDR 1.1 declares its gain map in XMP, ISO 21496-1 in a segment.
        """
        words = (b"ns.adobe.com/hdr-gain-map", b"ns.apple.com/HDRGainMap", b"urn:iso:std:iso:ts:21496:-1")
        bodies = [segment.body for segment in self.segments if segment.marker in (APP1, APP2)]
        if any(word in body for word in words for body in bodies):
            return ("the gain map (Ultra HDR) is of the old colours, and was left out: the picture is SDR now",)
        if any(segment.holds(PREVIEWS) for segment in self.segments):
            return ("the previews after the picture show the old colours, and were left out",)
        return ()


class _Header(JpegImageFile):
    def _read_dpi_from_exif(self) -> None:
        """Do not read EXIF: where it is damaged, Pillow would warn on the terminal."""


def read_header(data: bytes | mmap) -> JpegHeader | None:
    """Read the part of a file before its pixels; None for a file that is no JPEG or is damaged."""
    try:
        file = _Header(BytesIO(data))
        tables = tuple(tuple(file.quantization[table]) for *_, table in file.layer)
    except Exception:  # Pillow raises many types on damaged files
        return None
    if not file.tile or not tables:  # it ends before the pixels, or does not state how they are coded
        return None
    coded_by_ycc = file.info.get("adobe_transform", bytes(name for name, *_ in file.layer) != b"RGB") == 1
    return JpegHeader(
        *file.size,
        tuple(Segment(COMMENT if name == "COM" else APP0 + int(name[3:]), body) for name, body in file.applist),
        tables,
        tuple((horizontal, vertical) for _, horizontal, vertical, _ in file.layer),
        plain=file.layers == len(file.layer) == 3 and coded_by_ycc,
    )


def metadata_end(data: bytes) -> int:
    """Return the offset of the first byte after SOI and the metadata segments that follow it."""
    at = 2
    while data[at : at + 1] == b"\xff" and (APP0 <= data[at + 1] <= APP15 or data[at + 1] == COMMENT):
        at += 2 + int.from_bytes(data[at + 2 : at + 4], "big")
    return at
