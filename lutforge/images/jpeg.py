"""JPEG files by libjpeg-turbo itself: 8-bit pixels in and out, and every metadata segment byte for byte.

simplejpeg decodes: it is the fastest of the packages, and tells of damage. Pillow encodes: of those that work outside
Python's lock it alone takes quantization tables. Both hold a picture as red, green, blue and a fourth byte that means
nothing, which OpenColorIO packs fastest.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO, FileIO
from mmap import mmap
from pathlib import Path

import simplejpeg
from PIL import Image as Pillow
from PIL.JpegImagePlugin import JpegImageFile

from lutforge.arrays import Codes
from lutforge.errors import ImageError
from lutforge.images.tiff import byte_order, number, offset_in, read_directory

SOI, EOI = b"\xff\xd8", b"\xff\xd9"

COMMENT, APP0, APP1, APP2, APP15 = 0xFE, 0xE0, 0xE1, 0xE2, 0xEF
"""Second bytes of the markers of metadata segments (ITU-T T.81, table B.1)."""
EXIF, ICC, PREVIEWS, ADOBE = (APP1, b"Exif\0\0"), (APP2, b"ICC_PROFILE\0"), (APP2, b"MPF\0"), (0xEE, b"Adobe")
"""Marker and beginning of the segments that hold a TIFF structure, or a piece of an ICC profile (ICC.1:2022, B.4), that
say where further pictures begin (Multi-Picture Format, CIPA DC-007), or how colours are coded (libjpeg.txt)."""


@dataclass(frozen=True)
class Segment:
    """A metadata segment. marker: its second byte, APP0 … APP15 or COM; body: without marker and length."""

    marker: int
    body: bytes

    @property
    def stored(self) -> bytes:
        """The segment as it stands in a file."""
        return b"\xff" + bytes([self.marker]) + struct.pack(">H", len(self.body) + 2) + self.body

    def holds(self, kind: tuple[int, bytes]) -> bool:
        """Whether it is of a kind such as EXIF."""
        return self.marker == kind[0] and self.body.startswith(kind[1])


@dataclass(frozen=True)
class JpegHeader:
    """What stands in front of a JPEG's pixels.

    segments: the metadata, in the file's order. tables: 64 quantization steps for each component, row by row; sampling:
    horizontal and vertical factors for each. plain: 8-bit YCbCr, as cameras write.
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
    def says_adobe_rgb(self) -> bool:
        """True where EXIF says that the picture is in Adobe RGB, as DCF 2.0 has it."""
        block = self.exif or b""
        return block[exif_places(block).get("interoperability", slice(0))] == b"R03"

    @property
    def comments(self) -> tuple[str, ...]:
        """The text of the comment segments."""
        bodies = [segment.body for segment in self.segments if segment.marker == COMMENT]
        return tuple(body.rstrip(b"\0").decode("utf-8", "replace") for body in bodies)

    @property
    def icc(self) -> bytes:
        """The ICC profile, of all segments that hold a piece of it; empty where there is none."""
        pieces = [segment.body[len(ICC[1]) :] for segment in self.segments if segment.holds(ICC)]
        return b"".join(piece[2:] for piece in sorted(pieces, key=lambda piece: piece[:1]))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is left out of a graded file. Ultra HDR 1.1 names its gain map in XMP, ISO 21496-1 in a segment."""
        words = (b"ns.adobe.com/hdr-gain-map", b"urn:iso:std:iso:ts:21496:-1")
        bodies = [segment.body for segment in self.segments if segment.marker in (APP1, APP2)]
        if any(word in body for word in words for body in bodies):
            return ("the gain map (Ultra HDR) is of the old colours, and was left out: the picture is SDR now",)
        if any(segment.holds(PREVIEWS) for segment in self.segments):
            return ("the previews behind the picture show the old colours, and were left out",)
        return ()


class _Header(JpegImageFile):
    def _read_dpi_from_exif(self) -> None:
        """Leave EXIF alone: where it is damaged, Pillow would warn on the terminal."""


def read_header(data: bytes | mmap) -> JpegHeader | None:
    """Read what stands in front of the pixels; None for what is no JPEG, or a damaged one."""
    try:
        file = _Header(BytesIO(data))
        tables = tuple(tuple(file.quantization[table]) for *_, table in file.layer)
    except Exception:  # Pillow raises many types on damaged files
        return None
    if not file.tile or not tables:  # it ends before the pixels, or tells nothing of them
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


# --- Places in an EXIF block, so that a value can be changed where it stands -----------------------------------------


def exif_places(block: bytes) -> dict[str, slice]:
    """Find the bytes of some values in an EXIF block, a TIFF structure; empty where the block is damaged.

    "next directory" is the offset of the second directory, which holds the thumbnail; "colour space" two bytes;
    "interoperability" three, "R98" for sRGB and "R03" for Adobe RGB (DCF 2.0).
    """
    order = byte_order(block)
    if order is None or block[2:4] != struct.pack(f"{order}H", 42):
        return {}
    try:  # by the tags of Exif 2.32: 4.5.4, 4.6.3, 4.6.5 and 4.6.7
        start = number(block, order, "I", 4)
        first, _ = read_directory(block, order, start)
        exif = offset_in(block, order, first, 0x8769)
        photo, _ = ({}, 0) if exif is None else read_directory(block, order, exif)
        interoperability = offset_in(block, order, photo, 0xA005)
        colours, _ = ({}, 0) if interoperability is None else read_directory(block, order, interoperability)
        link = start + 2 + 12 * number(block, order, "H", start)
    except struct.error:  # an offset beyond the end
        return {}
    places = {"next directory": slice(link, link + 4)} if link + 4 <= len(block) else {}
    for name, entries, tag, size in (("colour space", photo, 0xA001, 2), ("interoperability", colours, 1, 3)):
        if tag in entries:
            places[name] = slice(entries[tag].place.start, entries[tag].place.start + size)
    return places


# --- Pixels, and the metadata of a source in its copy -----------------------------------------------------------------


_SUBSAMPLING: Mapping[tuple[tuple[int, int], ...], int] = {
    (of_luma, (1, 1), (1, 1)): number for number, of_luma in enumerate(((1, 1), (2, 1), (2, 2)))
}
"""Sampling factors of Y, Cb and Cr, and Pillow's numbers for them."""


def decode(path: Path, data: bytes, canvas: Codes) -> None:
    """Decode a JPEG into `canvas` (h, w, 3 or 4). Raises ImageError where it is damaged."""
    try:
        simplejpeg.decode_jpeg(data, "RGB" if canvas.shape[2] == 3 else "RGBX", buffer=canvas)
    except ValueError as error:
        raise ImageError(f"{path}: damaged or cut short ({error}); copy the file again") from error


def encode(file: FileIO, canvas: Codes, start: bytes, like: JpegHeader) -> None:
    """Write pixels (h, w, 4) as a JPEG with the quantization tables and chroma subsampling of another.

    start: SOI and the metadata segments, of at least 20 bytes.
    """
    tables = like.tables[:2] if like.tables[1] == like.tables[2] else like.tables
    picture = Pillow.frombuffer("RGBX", (canvas.shape[1], canvas.shape[0]), canvas, "raw", "RGBX", 0, 1)
    # Pillow begins with 20 bytes, SOI and a JFIF segment, in whose place come the source's own.
    file.seek(len(start) - 20)
    picture.save(
        file, "JPEG", quality=-1, subsampling=_SUBSAMPLING.get(like.sampling, 0),
        qtables=[list(steps) for steps in tables],
    )  # fmt: skip
    file.seek(-2, 2)
    if file.read(2) != EOI:
        raise OSError(None, "it was not written as a whole; is the disk full?")
    file.seek(len(start) - 20)
    if file.read(20)[:6] != SOI + b"\xff\xe0\0\x10":
        raise OSError(None, "Pillow began the file in another way than with 20 bytes of JFIF")
    file.seek(0)
    file.write(start)


def stored_metadata(segments: Sequence[Segment], plain: bool, comment: str) -> bytes:
    """SOI and the segments as they are, with a comment more."""

    def alone(block: bytes, places: dict[str, slice]) -> bytes:
        return _replaced(block, places["next directory"], bytes(4)) if "next directory" in places else block

    # Further pictures, and the thumbnail of the old colours, are left out, and so is what says where they begin; of
    # colours that are coded anew (not plain), what told of the old coding.
    segments = _with_exif(segments, alone)
    copied = [each for each in segments if not each.holds(PREVIEWS) and (plain or not each.holds(ADOBE))]
    told = Segment(COMMENT, comment.encode()[:65_000].ljust(16))
    return SOI + b"".join(each.stored for each in (*copied, told))


def with_colours(segments: Sequence[Segment], profile: bytes | None, adobe_rgb: bool) -> tuple[Segment, ...]:
    """The segments with another ICC profile, or none, and EXIF that says Adobe RGB or sRGB where it says either."""
    changed = [segment for segment in segments if not segment.holds(ICC)]
    pieces = [] if profile is None else [profile[at : at + 65_000] for at in range(0, len(profile), 65_000)]
    icc = [Segment(APP2, ICC[1] + bytes([at, len(pieces)]) + piece) for at, piece in enumerate(pieces, 1)]
    after = max((at + 1 for at, segment in enumerate(changed) if segment.marker in (APP0, APP1)), default=0)
    changed[after:after] = icc

    def colours(block: bytes, places: dict[str, slice]) -> bytes:
        space = struct.pack(f"{byte_order(block)}H", 0xFFFF if adobe_rgb else 1)
        for name, value in (("colour space", space), ("interoperability", b"R03" if adobe_rgb else b"R98")):
            block = _replaced(block, places[name], value) if name in places else block
        return block

    return _with_exif(changed, colours)


def _with_exif(segments: Sequence[Segment], change: Callable[[bytes, dict[str, slice]], bytes]) -> tuple[Segment, ...]:
    """The segments with a change of the EXIF block that keeps its length."""
    changed = []
    for segment in segments:
        block = segment.body[len(EXIF[1]) :]
        places = exif_places(block) if segment.holds(EXIF) else {}
        changed.append(Segment(APP1, EXIF[1] + change(block, places)) if places else segment)
    return tuple(changed)


def _replaced(block: bytes, place: slice, new: bytes) -> bytes:
    return block[: place.start] + new + block[place.stop :]
