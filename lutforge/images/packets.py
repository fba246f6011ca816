"""Packets of metadata as the file of a picture stores them: XMP, IPTC and EXIF.

They are read of JPEG (segments), PNG (chunks), WebP (RIFF chunks), JPEG 2000 (boxes), TIFF (fields) and HEIF. A damaged
file has no packets.
"""

import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np

from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.chunks import JP2_SIGNATURE, PNG_SIGNATURE, box_at, chunks_of, png_chunk, riff_chunk
from lutforge.images.heif import is_heif, read_heif_description
from lutforge.images.iptc import PHOTOSHOP, iptc_of
from lutforge.images.jpeg import APP1, EXIF, SOI, read_header
from lutforge.images.stated_encoding import of_codes, of_gamma_and_primaries
from lutforge.images.tiff import Entry, byte_order, number, offset_in, read_directory
from lutforge.images.xmp import EXTENSION, XMP_SEGMENT, with_extension

PNG_XMP = b"XML:com.adobe.xmp\0"
"""Keyword of the text in which a PNG stores XMP."""
_PNG_IPTC = b"Raw profile type iptc\0"
"""Keyword of the text in which ImageMagick and exiftool store IPTC in a PNG, which has no place for it."""
UUID_EXIF = b"JpgTiffExif->JP2"
UUID_XMP = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
UUID_IPTC = bytes.fromhex("33c7a4d2b81d4723a0baf1a3e097ad38")
"""Kinds of boxes of JPEG 2000, which precede the packet in a box "uuid"."""
TIFF_XMP, TIFF_IPTC = 700, 33723
_TIFF_TABLES, _TIFF_WHITE, _TIFF_PRIMARIES, _TIFF_ICC = 301, 318, 319, 34675
"""Tags of TIFF."""
_PHOTO_DIRECTORY, _MAKER_NOTE, _USER_COMMENT = 0x8769, 0x927C, 0x9286
"""Tags of EXIF."""
_LARGEST = 1 << 24
"""Bytes of a packet that is read."""


@dataclass(frozen=True)
class Packets:
    """The contents of a picture's file besides its pixels.

    xmp, iptc: packets as the file has them, empty where there are none; exif: the same, but of JPEG 2000 only, where
    OpenImageIO does not look for it. animated: the file has several frames. lossless: it is a WebP without loss.
    extended: a JPEG's XMP continues beyond 64 kB, and this extension is damaged and not in `xmp`. encoding: the
    one that a PNG, TIFF or HEIF without an ICC profile states, if that is not sRGB. not_described: the parts of its
    EXIF that a description of OpenImageIO cannot hold.
    """

    xmp: bytes = b""
    iptc: bytes = b""
    exif: bytes = b""
    animated: bool = False
    lossless: bool = False
    extended: bool = False
    encoding: str = ""
    not_described: tuple[str, ...] = ()


def read_packets(path: Path) -> Packets:
    """Read the packets in a picture's file; a damaged one, or one of another format, has none."""
    try:
        if is_heif(path):
            return read_heif_packets(path)
        with reading(path, "metadata", ImageError):
            if path.stat().st_size == 0:  # which cannot be mapped
                return Packets()
            with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                return packets_of(data)
    except ImageError:
        return Packets()


def packets_of(data: bytes | mmap) -> Packets:
    """Read what the bytes of a file store. Damaged ones raise what `boundary.reading` translates."""
    if data[:2] == SOI:
        return _jpeg_packets(data)
    if data[:8] == PNG_SIGNATURE:
        return _png_packets(data)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        chunks = dict(reversed(list(chunks_of(data, 12, riff_chunk))))  # the first of a name counts
        xmp, exif = (data[chunks.get(name, slice(0))] for name in (b"XMP ", b"EXIF"))
        missing = _not_described(exif.removeprefix(EXIF[1]))
        return Packets(xmp, animated=b"ANIM" in chunks, lossless=b"VP8L" in chunks, not_described=missing)
    if data[:12] == JP2_SIGNATURE:
        bodies = [data[place] for name, place in chunks_of(data, 0, box_at) if name == b"uuid"]
        packets = {body[:16]: body[16:] for body in reversed(bodies)}  # the first of a kind counts
        xmp, iptc, exif = (packets.get(kind, b"") for kind in (UUID_XMP, UUID_IPTC, UUID_EXIF))
        return Packets(xmp, iptc, exif, not_described=_not_described(exif))
    order = byte_order(data[:2])
    if order is not None and data[2:4] == struct.pack(f"{order}H", 42):
        entries, _ = read_directory(data, order, number(data, order, "I", 4))
        xmp, iptc = (data[entries[tag].place] if tag in entries else b"" for tag in (TIFF_XMP, TIFF_IPTC))
        return Packets(xmp, iptc, encoding=_tiff_encoding(data, order, entries), not_described=_not_described(data))
    return Packets()


def _jpeg_packets(data: bytes | mmap) -> Packets:
    """The packets of a JPEG."""
    header = read_header(data)
    segments = () if header is None else header.segments
    xmp = [segment.body[len(XMP_SEGMENT) :] for segment in segments if segment.holds((APP1, XMP_SEGMENT))]
    resources = b"".join(segment.body[len(PHOTOSHOP[1]) :] for segment in segments if segment.holds(PHOTOSHOP))
    whole = xmp[0] if xmp else b""
    extended = any(segment.holds(EXTENSION) for segment in segments)
    if extended and (joined := with_extension(whole, segments)) is not None:
        whole, extended = joined, False
    missing = _not_described(b"" if header is None or header.exif is None else header.exif)
    return Packets(whole, iptc_of(resources), extended=extended, not_described=missing)


def _png_packets(data: bytes | mmap) -> Packets:
    """The packets of a PNG: XMP in an iTXt chunk, IPTC in a zTXt or tEXt chunk."""
    xmp = iptc = b""
    chunks = [(name, place) for name, place in chunks_of(data, 8, png_chunk) if place.stop - place.start <= _LARGEST]
    for name, place in chunks:
        if name not in (b"iTXt", b"zTXt", b"tEXt"):
            continue
        body = data[place]
        if name == b"iTXt" and body.startswith(PNG_XMP) and not xmp:
            # Whether it is compressed, the method, two texts that end in a null, and the packet.
            is_compressed = body[len(PNG_XMP)] == 1
            packet = body[len(PNG_XMP) + 2 :].split(b"\0", 2)[-1]
            xmp = _decompressed(packet) if is_compressed else packet
        elif name != b"iTXt" and body.startswith(_PNG_IPTC) and not iptc:
            # A line with a name, one with the length, and hexadecimal digits.
            text = body[len(_PNG_IPTC) :] if name == b"tEXt" else _decompressed(body[len(_PNG_IPTC) + 1 :])
            iptc = iptc_of(bytes.fromhex(b"".join(text.split()[3:]).decode("ascii")))

    animated = any(name == b"acTL" for name, _ in chunks)
    colours = {name: data[place] for name, place in chunks if name in (b"cICP", b"iCCP", b"sRGB", b"gAMA", b"cHRM")}
    exif = next((data[place] for name, place in chunks if name == b"eXIf"), b"")
    encoding = _png_encoding(colours)
    return Packets(xmp, iptc, animated=animated, encoding=encoding, not_described=_not_described(exif))


def _not_described(block: bytes | mmap) -> tuple[str, ...]:
    """The parts of a TIFF structure of EXIF that OpenImageIO cannot read because of their type (Exif 2.32, 4.6.5)."""
    order = byte_order(block[:2])
    if order is None or len(block) < 8:
        return ()
    try:
        first, _ = read_directory(block, order, number(block, order, "I", 4))
        place = offset_in(block, order, first, _PHOTO_DIRECTORY)
        photo, _ = ({}, 0) if place is None else read_directory(block, order, place)
    except struct.error:  # an offset beyond the end
        return ()
    comment = block[photo[_USER_COMMENT].place] if _USER_COMMENT in photo else b""
    # Cameras write an empty one: eight bytes of a character set, then blanks.
    written = bool(comment[8:].strip(b" \0"))
    return (*(["maker notes"] if _MAKER_NOTE in photo else []), *(["the user comment of EXIF"] if written else []))


def _decompressed(text: bytes) -> bytes:
    """Compressed text of a PNG, as far as _LARGEST bytes."""
    return zlib.decompressobj().decompress(text, _LARGEST)


def _png_encoding(chunks: dict[bytes, bytes]) -> str:
    """The encoding that a PNG states: by cICP, else iCCP, sRGB, gAMA and cHRM, in this order (PNG 3, 4.3)."""
    if len(codes := chunks.get(b"cICP", b"")) == 4:
        return of_codes(codes[0], codes[1], codes[3] != 0)
    if b"iCCP" in chunks or b"sRGB" in chunks:
        return ""
    gamma, corners = chunks.get(b"gAMA", b""), chunks.get(b"cHRM", b"")
    exponent = number(gamma, ">", "I", 0) / 100_000 if len(gamma) == 4 else 0.0
    stated = tuple(value / 100_000 for value in struct.unpack(">8I", corners)) if len(corners) == 32 else ()
    return of_gamma_and_primaries(exponent, stated)


def _tiff_encoding(data: bytes | mmap, order: str, entries: Mapping[int, Entry]) -> str:
    """The encoding that a TIFF states by its tables of linear light, its white and its primaries (TIFF 6, 20)."""
    if _TIFF_ICC in entries:
        return ""
    table, white, primaries = (
        np.frombuffer(data[entries[tag].place], f"{order}u{size}").astype(np.float64) if tag in entries else np.zeros(0)
        for tag, size in ((_TIFF_TABLES, 2), (_TIFF_WHITE, 4), (_TIFF_PRIMARIES, 4))
    )
    # A table states the linear light of each code, for one channel or three: a power, by its middle.
    channel = table[: len(table) // 3] if len(table) % 3 == 0 else table
    place = len(channel) // 2
    middle = float(channel[place]) / 65535 if place else 0.0
    exponent = float(np.log(place / (len(channel) - 1)) / np.log(middle)) if 0 < middle < 1 and place > 1 else 0.0
    stated = np.concatenate([white, primaries])
    chromaticities = stated[::2] / np.maximum(stated[1::2], 1) if len(stated) == 16 else np.zeros(0)
    return of_gamma_and_primaries(exponent, tuple(chromaticities.tolist()))


def read_heif_packets(path: Path) -> Packets:
    """The packets of a HEIF file: XMP, and the code points of its colours. Raises ImageError as `read_heif`."""
    described = read_heif_description(path)
    primaries = 0 if described.icc else described.primaries
    encoding = of_codes(primaries, described.transfer)
    return Packets(described.xmp, encoding=encoding, not_described=_not_described(described.exif))
