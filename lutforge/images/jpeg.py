"""JPEG files by libjpeg-turbo itself: 8-bit pixels in and out, and every metadata segment byte for byte.

simplejpeg decodes: it is the fastest of the packages, and tells of damage. Pillow encodes: of those that work outside
Python's lock it alone takes quantization tables. Both hold a picture as red, green, blue and a fourth byte that means
nothing, which OpenColorIO packs fastest.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import blake2b
from io import BytesIO, FileIO
from mmap import mmap
from pathlib import Path

import numpy as np
import simplejpeg
from PIL import Image as Pillow

from lutforge.arrays import Codes
from lutforge.errors import ImageError
from lutforge.images.exif import PREFIX, ExifPlaces, exif_places

SOI, EOI = b"\xff\xd8", b"\xff\xd9"
COMMENT, APP0, EXIF, APP2, ADOBE = 0xFE, 0xE0, 0xE1, 0xE2, 0xEE
_ICC, _PREVIEWS = b"ICC_PROFILE\0", b"MPF\0"

_SUBSAMPLING: Mapping[tuple[tuple[int, int], ...], int] = {
    ((1, 1), (1, 1), (1, 1)): 0,
    ((2, 1), (1, 1), (1, 1)): 1,
    ((2, 2), (1, 1), (1, 1)): 2,
}
"""Sampling factors of Y, Cb and Cr, and Pillow's numbers for them."""

_ZIGZAG = sorted(range(64), key=lambda at: (at // 8 + at % 8, at // 8 if (at // 8 + at % 8) % 2 else at % 8))
"""Place in the 8 × 8 table of each entry as a file stores it (ITU-T T.81, figure A.6)."""


@dataclass(frozen=True)
class Segment:
    """A metadata segment. marker: its second byte, APP0 … APP15 or COM; body: without marker and length."""

    marker: int
    body: bytes

    @property
    def stored(self) -> bytes:
        """The segment as it stands in a file."""
        return b"\xff" + bytes([self.marker]) + struct.pack(">H", len(self.body) + 2) + self.body


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
        found = (segment.body for segment in self.segments if _is_exif(segment))
        return next((body[len(PREFIX) :] for body in found), None)

    @property
    def encoder(self) -> str:
        """What tells the encoder: "libjpeg" for its own tables, else a digest of tables, sampling and size.

        Most cameras have tables of their own (Kee, Johnson & Farid 2011, "Digital image authentication from JPEG
        headers", https://doi.org/10.1109/TIFS.2011.2128309); libjpeg's, which most programs write, are those of
        ITU-T T.81, Annex K, scaled.
        """
        if _libjpeg_tables().issuperset(self.tables):
            return "libjpeg"
        told = self.tables, self.sampling, sorted((self.width, self.height))
        return blake2b(repr(told).encode(), digest_size=8).hexdigest()

    @property
    def says_adobe_rgb(self) -> bool:
        """True where EXIF says that the picture is in Adobe RGB, as DCF 2.0 has it."""
        block = self.exif or b""
        places = exif_places(block)
        return places is not None and places.interoperability is not None and block[places.interoperability] == b"R03"

    @property
    def comments(self) -> tuple[str, ...]:
        """The text of the comment segments."""
        bodies = [segment.body for segment in self.segments if segment.marker == COMMENT]
        return tuple(body.rstrip(b"\0").decode("utf-8", "replace") for body in bodies)

    @property
    def icc(self) -> bytes:
        """The ICC profile, of all segments that hold a piece of it (ICC.1:2022, B.4); empty where there is none."""
        pieces = [segment.body for segment in self.segments if segment.marker == APP2 and segment.body.startswith(_ICC)]
        return b"".join(piece[len(_ICC) + 2 :] for piece in sorted(pieces, key=lambda piece: piece[len(_ICC)]))

    @property
    def has_previews(self) -> bool:
        """True where further pictures follow the first, as of the Multi-Picture Format (CIPA DC-007)."""
        return any(segment.marker == APP2 and segment.body.startswith(_PREVIEWS) for segment in self.segments)

    @property
    def has_gain_map(self) -> bool:
        """True where a gain map for HDR displays follows: Ultra HDR 1.1 says so in XMP, ISO 21496-1 in a segment."""
        told = (b"ns.adobe.com/hdr-gain-map", b"urn:iso:std:iso:ts:21496:-1")
        return any(
            segment.marker in (EXIF, APP2) and any(word in segment.body for word in told) for segment in self.segments
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
        if APP0 <= marker <= 0xEF or marker == COMMENT:
            segments.append(Segment(marker, body))
        elif marker == 0xDB:
            tables |= _tables(body)
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            frame, kind = body, marker
        elif marker == 0xDA:
            return _header(frame, kind, tables, tuple(segments))
        at += 4 + len(body)
    return None


@cache
def _libjpeg_tables() -> frozenset[tuple[int, ...]]:
    """The tables of libjpeg's qualities 1 to 100 (jpeg_set_quality), luma's and chroma's."""
    file = BytesIO()
    Pillow.new("RGB", (8, 8)).save(file, "JPEG", quality=50)  # which scales nothing
    header = read_header(file.getvalue())
    scales = [5000 // quality if quality < 50 else 200 - 2 * quality for quality in range(1, 101)]
    return frozenset(
        tuple(min(max((step * scale + 50) // 100, 1), 255) for step in table)
        for table in (() if header is None else header.tables)
        for scale in scales
    )


def metadata_end(data: bytes) -> int:
    """Return the offset of the first byte after SOI and the metadata segments that follow it."""
    at = 2
    while data[at : at + 1] == b"\xff" and (APP0 <= data[at + 1] <= 0xEF or data[at + 1] == COMMENT):
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
    transform = [segment.body[11] for segment in segments if _is_adobe(segment)]
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


def _is_exif(segment: Segment) -> bool:
    return segment.marker == EXIF and segment.body.startswith(PREFIX)


def _is_adobe(segment: Segment) -> bool:
    """Whether a segment tells how colours are coded (libjpeg.txt, "Special markers")."""
    return segment.marker == ADOBE and len(segment.body) >= 12 and segment.body.startswith(b"Adobe")


def decode(path: Path, data: bytes, canvas: Codes) -> None:
    """Decode a JPEG into `canvas` (h, w, 4). Raises ImageError where it is damaged."""
    try:
        simplejpeg.decode_jpeg(data, "RGBX", buffer=canvas)
    except ValueError as error:
        raise ImageError(f"{path}: damaged or cut short ({error}); copy the file again") from error


def encode(file: FileIO, canvas: Codes, start: bytes, like: JpegHeader, quality: int | None = None) -> None:
    """Write pixels (h, w, 4) as a JPEG with the quantization tables and chroma subsampling of another.

    start: SOI and the metadata segments, of at least 20 bytes. quality: of libjpeg, in place of the tables.
    Raises OSError.
    """
    tables = like.tables[:2] if like.tables[1] == like.tables[2] else like.tables
    picture = Pillow.frombuffer("RGBX", (canvas.shape[1], canvas.shape[0]), canvas, "raw", "RGBX", 0, 1)
    # Pillow begins with 20 bytes, SOI and a JFIF segment, in whose place come the source's own.
    file.seek(len(start) - 20)
    picture.save(
        file, "JPEG", quality=-1 if quality is None else quality, subsampling=_SUBSAMPLING.get(like.sampling, 0),
        qtables=[list(steps) for steps in tables] if quality is None else None,
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
    """SOI and the segments as they are, with a comment more.

    What says where further pictures begin is left out, since these are not copied, and where colours are coded anew
    (not `plain`) what told of the old coding.
    """
    kept = [
        segment.stored
        for segment in segments
        if not (segment.marker == APP2 and segment.body.startswith(_PREVIEWS)) and (plain or not _is_adobe(segment))
    ]
    return b"".join([SOI, *kept, Segment(COMMENT, comment.encode()[:65_000].ljust(16)).stored])


def with_colours(segments: Sequence[Segment], profile: bytes | None, adobe_rgb: bool) -> tuple[Segment, ...]:
    """The segments with another ICC profile, or none, and EXIF that says Adobe RGB or sRGB where it says either."""
    changed = [segment for segment in segments if not (segment.marker == APP2 and segment.body.startswith(_ICC))]
    pieces = [] if profile is None else [profile[at : at + 65_000] for at in range(0, len(profile), 65_000)]
    icc = [Segment(APP2, _ICC + bytes([at, len(pieces)]) + piece) for at, piece in enumerate(pieces, 1)]
    after = max((at + 1 for at, segment in enumerate(changed) if segment.marker in (APP0, EXIF)), default=0)
    changed[after:after] = icc

    def colours(block: bytes, places: ExifPlaces) -> bytes:
        space = struct.pack(f"{places.order}H", 0xFFFF if adobe_rgb else 1)
        block = _replaced(block, places.colour_space, space)
        return _replaced(block, places.interoperability, b"R03" if adobe_rgb else b"R98")

    return _with_exif(changed, colours)


def with_thumbnail(segments: Sequence[Segment], grade: Callable[[Codes], None]) -> tuple[Segment, ...]:
    """The segments with the EXIF thumbnail graded in its place: not a byte around it changes.

    grade: changes pixels (h, w, 4) in place. A thumbnail that cannot be decoded stays as it is.
    """

    def graded(block: bytes, places: ExifPlaces) -> bytes:
        if places.thumbnail is None:
            return block
        old = block[places.thumbnail]
        header = read_header(old)
        if header is None or not header.plain or header.width * header.height > 1 << 20:
            return block
        canvas = np.empty((header.height, header.width, 4), np.uint8)
        try:
            simplejpeg.decode_jpeg(old, "RGBX", buffer=canvas, strict=False)
        except ValueError:
            return block
        grade(canvas)
        new = _small(canvas, header, len(old))
        return block if new is None else _replaced(block, places.thumbnail, new)

    return _with_exif(segments, graded)


def _with_exif(segments: Sequence[Segment], change: Callable[[bytes, ExifPlaces], bytes]) -> tuple[Segment, ...]:
    """The segments with a change of the EXIF block that keeps its length."""
    changed = []
    for segment in segments:
        block = segment.body[len(PREFIX) :]
        places = exif_places(block) if _is_exif(segment) else None
        changed.append(segment if places is None else Segment(EXIF, PREFIX + change(block, places)))
    return tuple(changed)


def _replaced(block: bytes, place: slice | None, new: bytes) -> bytes:
    return block if place is None else block[: place.start] + new + block[place.stop :]


def _small(canvas: Codes, like: JpegHeader, length: int) -> bytes | None:
    """A thumbnail encoded to exactly `length` bytes; None where not even the coarsest fits.

    It is as fine as they allow, and filled up with bytes that mean nothing (ITU-T T.81, B.1.1.2).
    """
    for coarser in (1.0, 1.25, 1.6, 2.5, 4.0, 8.0):
        encoded = BytesIO()
        tables = [[min(255, round(step * coarser)) for step in steps] for steps in like.tables]
        picture = Pillow.frombuffer("RGBX", (canvas.shape[1], canvas.shape[0]), canvas, "raw", "RGBX", 0, 1)
        picture.save(encoded, "JPEG", qtables=tables, subsampling=_SUBSAMPLING.get(like.sampling, 0), optimize=True)
        data = SOI + encoded.getvalue()[20:]  # thumbnails have no JFIF segment (Exif 2.32, 4.5.5)
        if len(data) <= length:
            return data[:-2] + b"\xff" * (length - len(data)) + EOI
    return None
