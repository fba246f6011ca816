"""JPEG files by libjpeg-turbo itself: 8-bit pixels in and out, and the metadata of a source in its copy.

simplejpeg decodes: it is the fastest of the packages, and tells of damage. Pillow encodes: of those that work outside
Python's lock it alone takes quantization tables. Both hold a picture as red, green, blue and a fourth byte that means
nothing, which OpenColorIO packs fastest.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from io import BytesIO, FileIO
from pathlib import Path

import numpy as np
import simplejpeg
from PIL import Image as Pillow

from lutforge.arrays import Codes
from lutforge.errors import ImageError
from lutforge.images.jpeg_header import (
    EOI,
    ICC,
    PREFIX,
    SOI,
    ExifPlaces,
    JpegHeader,
    Marker,
    Segment,
    exif_places,
    read_header,
)

_SUBSAMPLING: Mapping[tuple[tuple[int, int], ...], int] = {
    ((1, 1), (1, 1), (1, 1)): 0,
    ((2, 1), (1, 1), (1, 1)): 1,
    ((2, 2), (1, 1), (1, 1)): 2,
}
"""Sampling factors of Y, Cb and Cr, and Pillow's numbers for them."""


def decode(path: Path, data: bytes, canvas: Codes) -> None:
    """Decode a JPEG into `canvas` (h, w, 3 or 4). Raises ImageError where it is damaged."""
    try:
        simplejpeg.decode_jpeg(data, "RGB" if canvas.shape[2] == 3 else "RGBX", buffer=canvas)
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
    kept = [segment.stored for segment in segments if not segment.tells_previews and (plain or not segment.is_adobe)]
    return b"".join([SOI, *kept, Segment(Marker.COMMENT, comment.encode()[:65_000].ljust(16)).stored])


def with_colours(segments: Sequence[Segment], profile: bytes | None, adobe_rgb: bool) -> tuple[Segment, ...]:
    """The segments with another ICC profile, or none, and EXIF that says Adobe RGB or sRGB where it says either."""
    changed = [segment for segment in segments if not segment.is_icc]
    pieces = [] if profile is None else [profile[at : at + 65_000] for at in range(0, len(profile), 65_000)]
    icc = [Segment(Marker.APP2, ICC + bytes([at, len(pieces)]) + piece) for at, piece in enumerate(pieces, 1)]
    after = max(
        (at + 1 for at, segment in enumerate(changed) if segment.marker in (Marker.APP0, Marker.EXIF)), default=0
    )
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
        places = exif_places(block) if segment.is_exif else None
        changed.append(segment if places is None else Segment(Marker.EXIF, PREFIX + change(block, places)))
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
