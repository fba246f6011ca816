"""Packets of metadata as a file stores them, XMP and EXIF: read of any format, written where OpenImageIO writes none.

PNG (chunks), WebP (RIFF chunks), JPEG 2000 (boxes) and TIFF (fields). A damaged file has no packets.
"""

import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.jpeg import APP0, APP1, EXIF, SOI, Segment, metadata_end, read_header
from lutforge.images.tiff import byte_order, number, read_directory

XMP_SEGMENT = b"http://ns.adobe.com/xap/1.0/\0"
_PNG, _JP2 = b"\x89PNG\r\n\x1a\n", b"\0\0\0\x0cjP  \r\n\x87\n"
_PNG_XMP = b"XML:com.adobe.xmp\0"
_UUID_EXIF, _UUID_XMP = b"JpgTiffExif->JP2", bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
_UUID_IPTC = bytes.fromhex("33c7a4d2b81d4723a0baf1a3e097ad38")
_TIFF_XMP = 700
_LARGEST = 1 << 24
"""Bytes of a packet that is read."""

# A packet is padded with tens of thousands of spaces, and one that is not trusted may repeat anything: each pattern
# looks at a byte a fixed number of times. (?<!\s) begins at the first space of a run alone.
_GAIN_MAP = re.compile(rb"(?<!\s)\s+hdrgm:\w+\s*=\s*(\"[^\"]*\"|'[^']*')")
_MOTION = re.compile(
    rb"(?<!\s)\s+(?:GCamera|Camera|OpCamera|MiCamera):(?:MotionPhoto|MicroVideo)\w*\s*=\s*(\"[^\"]*\"|'[^']*')"
)
_MOTION_ELEMENT = re.compile(rb"<((?:GCamera|Camera):(?:MotionPhoto|MicroVideo)\w*)>[^<]*</\1>")
_DIRECTORY = re.compile(rb"<Container:Directory\b.*?</Container:Directory\s*>", re.DOTALL)
_DIRECTORY_END = re.compile(rb"</Container:Directory\s*>")


def without_further_pictures(xmp: bytes) -> bytes:
    """An XMP packet that declares no gain map, film or other item behind the picture (Ultra HDR, motion photos)."""
    for declared in (_GAIN_MAP, _MOTION, _MOTION_ELEMENT):
        xmp = declared.sub(b"", xmp)

    # Behind the last end of a list no search for one begins, which would go through the rest of the packet in vain.
    ends = [end.end() for end in _DIRECTORY_END.finditer(xmp)]
    last = ends[-1] if ends else 0
    return _DIRECTORY.sub(b"", xmp[:last]) + xmp[last:]


def declares_film(xmp: bytes) -> bool:
    """Whether an XMP packet says that a film follows the picture."""
    return bool(_MOTION.search(xmp) or _MOTION_ELEMENT.search(xmp))


@dataclass(frozen=True)
class Packets:
    """What a file stores besides its pixels.

    xmp: a packet as the file has it, empty where there is none. animated: several frames. lossless: a WebP without
    loss. unread: kinds of metadata that the file has and nothing here reads. encoding: "PQ", "HLG" or "linear" where a
    PNG says that it is encoded so.
    """

    xmp: bytes = b""
    animated: bool = False
    lossless: bool = False
    unread: tuple[str, ...] = ()
    encoding: str = ""


def read_packets(path: Path) -> Packets:
    """Read what a picture's file stores; nothing of a damaged one or another format."""
    try:
        with reading(path, "metadata", ImageError):
            if path.stat().st_size == 0:  # which cannot be mapped
                return Packets()
            with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                return packets_of(data)
    except ImageError:
        return Packets()


def packets_of(data: bytes | mmap) -> Packets:
    """Read what the bytes of a file store. Damaged ones raise what `boundary.reading` translates."""
    if data[:2] == b"\xff\xd8":
        header = read_header(data)
        segments = () if header is None else header.segments
        bodies = [each.body for each in segments if each.holds((APP1, XMP_SEGMENT))]
        return Packets(bodies[0][len(XMP_SEGMENT) :] if bodies else b"")
    if data[:8] == _PNG:
        chunks = list(_png_chunks(data))
        texts = [body[len(_PNG_XMP) :] for name, body in chunks if name == b"iTXt" and body.startswith(_PNG_XMP)]
        xmp = b""
        if texts:  # compressed or not, the method, two texts that end in a null
            packed, rest = texts[0][:1] == b"\1", texts[0][2:].split(b"\0", 2)[-1]
            xmp = zlib.decompressobj().decompress(rest, _LARGEST) if packed else rest
        return Packets(xmp, any(name == b"acTL" for name, _ in chunks), encoding=_png_encoding(dict(chunks)))
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        found = dict(reversed(list(_riff_chunks(data))))
        return Packets(found.get(b"XMP ", b""), b"ANIM" in found, b"VP8L" in found)
    if data[:12] == _JP2:
        uuids = [body for name, body in _boxes(data) if name == b"uuid"]
        exif, iptc = (any(body[:16] == kind for body in uuids) for kind in (_UUID_EXIF, _UUID_IPTC))
        unread = (*(("EXIF", "GPS") if exif else ()), *(("IPTC",) if iptc else ()))
        return Packets(next((body[16:] for body in uuids if body[:16] == _UUID_XMP), b""), unread=unread)
    order = byte_order(data[:2])
    if order is not None and data[2:4] == struct.pack(f"{order}H", 42):
        entries, _ = read_directory(data, order, number(data, order, "I", 4))
        return Packets(data[entries[_TIFF_XMP].place] if _TIFF_XMP in entries else b"")
    return Packets()


def _png_encoding(chunks: dict[bytes, bytes]) -> str:
    """What encodes a PNG, if it is no usual gamma: by cICP, else iCCP, sRGB, gAMA, in this order (PNG 3, 4.3)."""
    if (codes := chunks.get(b"cICP", b"")) and len(codes) == 4:
        return {8: "linear", 16: "PQ", 18: "HLG"}.get(codes[1], "")
    if b"iCCP" in chunks or b"sRGB" in chunks:
        return ""
    gamma = chunks.get(b"gAMA", b"")
    return "linear" if len(gamma) == 4 and struct.unpack(">I", gamma)[0] == 100_000 else ""


def exif_block(spec: oiio.ImageSpec) -> bytes:
    """The TIFF structure of EXIF, GPS included, that OpenImageIO writes of a description; empty where it has none."""
    small = oiio.ImageSpec(8, 8, 3, oiio.UINT8)
    for attribute in spec.extra_attribs:
        if attribute.name.startswith(("Exif:", "GPS:")) or ":" not in attribute.name:
            value = attribute.value
            if isinstance(value, str):  # OpenImageIO takes no bytes back that are no text
                value = value.encode("utf-8", "replace").decode("utf-8")
            small.attribute(attribute.name, attribute.type, value)
    for name in ("compression", "ICCProfile", "planarconfig"):
        small.erase_attribute(name)
    with scratch_folder() as folder:
        target = oiio.ImageOutput.create("exif.jpg")
        assert target is not None
        target.open(str(folder / "exif.jpg"), small)
        target.write_image(np.zeros((8, 8, 3), np.uint8))
        target.close()
        header = read_header((folder / "exif.jpg").read_bytes())
    return b"" if header is None or header.exif is None else header.exif


def add_packets(path: Path, format: str, spec: oiio.ImageSpec, xmp: bytes) -> None:
    """Put XMP into a file that OpenImageIO wrote: JPEG, TIFF, PNG, WebP, JPEG 2000; the last two get EXIF, too."""
    if format == "tiff":
        if xmp:
            _put_into_tiff(path, xmp)
        return
    if format not in ("jpeg", "png", "webp", "jpeg2000"):
        return
    data = path.read_bytes()
    if format == "jpeg" and 0 < len(xmp) < 65_000:
        header = read_header(data)
        if header is None:
            return
        kept = [segment for segment in header.segments if not segment.holds((APP1, XMP_SEGMENT))]
        places = [at + 1 for at, segment in enumerate(kept) if segment.marker == APP0 or segment.holds(EXIF)]
        kept.insert(max(places, default=0), Segment(APP1, XMP_SEGMENT + xmp))
        path.write_bytes(SOI + b"".join(segment.stored for segment in kept) + data[metadata_end(data) :])
    elif format == "png" and xmp:
        body = _PNG_XMP + bytes(4) + xmp
        chunk = struct.pack(">I", len(body)) + b"iTXt" + body + struct.pack(">I", zlib.crc32(b"iTXt" + body))
        path.write_bytes(data[:33] + chunk + data[33:])  # behind IHDR
    elif format == "webp":
        path.write_bytes(_webp_with(data, spec, exif_block(spec), xmp))
    elif format == "jpeg2000" and data[:12] == _JP2:
        profile = spec.getattribute("ICCProfile")
        boxes = [(b"uuid", _UUID_EXIF + exif_block(spec)), (b"uuid", _UUID_XMP + xmp)]
        added = b"".join(_box(name, body) for name, body in boxes if len(body) > 16)
        parts = []
        for name, body in _boxes(data):
            if name == b"jp2h" and profile is not None:
                colour = _box(b"colr", b"\2\0\0" + bytes(profile))
                inner = [colour if each == b"colr" else _box(each, part) for each, part in _boxes(body)]
                body = b"".join(inner)
            if name == b"jp2c":
                parts.append(added)
            parts.append(_box(name, body))
        path.write_bytes(b"".join(parts))


def _put_into_tiff(path: Path, xmp: bytes) -> None:
    """Write the first directory anew, at the end of the file, with the packet; BigTIFF files stay as they are."""
    with path.open("r+b") as file:
        head = file.read(8)
        order = byte_order(head)
        if order is None or number(head, order, "H", 2) != 42:
            return
        file.seek(number(head, order, "I", 4))
        count = number(file.read(2), order, "H", 0)
        entries = [file.read(12) for _ in range(count)]
        following = file.read(4)
        end = file.seek(0, 2)
        packet = end + end % 2
        directory = packet + len(xmp) + len(xmp) % 2
        if directory + 12 * count + 20 >= 1 << 32:
            return
        entries = [entry for entry in entries if number(entry, order, "H", 0) != _TIFF_XMP]
        entries.append(struct.pack(f"{order}HHII", _TIFF_XMP, 1, len(xmp), packet))
        entries.sort(key=lambda entry: number(entry, order, "H", 0))
        stored = struct.pack(f"{order}H", len(entries)) + b"".join(entries) + following
        file.write(bytes(end % 2) + xmp + bytes(len(xmp) % 2) + stored)
        file.seek(4)
        file.write(struct.pack(f"{order}I", directory))


def _webp_with(data: bytes, spec: oiio.ImageSpec, exif: bytes, xmp: bytes) -> bytes:
    """A WebP file with chunks more (WebP Container Specification, extended format)."""
    chunks = [(name, body) for name, body in _riff_chunks(data) if name not in (b"EXIF", b"XMP ")]
    flags = dict(chunks).get(b"VP8X", b"\0")[0] | (8 if exif else 0) | (4 if xmp else 0)
    flags |= 16 if spec.alpha_channel >= 0 else 0
    size = struct.pack("<I", spec.width - 1)[:3] + struct.pack("<I", spec.height - 1)[:3]
    chunks = [(b"VP8X", bytes([flags, 0, 0, 0]) + size), *((n, b) for n, b in chunks if n != b"VP8X")]
    chunks += [(name, body) for name, body in ((b"EXIF", exif), (b"XMP ", xmp)) if body]
    whole = b"".join(name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2) for name, body in chunks)
    return b"RIFF" + struct.pack("<I", len(whole) + 4) + b"WEBP" + whole


def _png_chunks(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    at = 8
    while at + 12 <= len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        if length > len(data) - at - 12:
            return
        yield name, b"" if name == b"IDAT" or length > _LARGEST else data[at + 8 : at + 8 + length]
        at += 12 + length


def _riff_chunks(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    at = 12
    while at + 8 <= len(data):
        name, length = struct.unpack_from("<4sI", data, at)
        if length > len(data) - at - 8:
            return
        yield name, data[at + 8 : at + 8 + length]
        at += 8 + length + length % 2


def _boxes(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    at = 0
    while at + 8 <= len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        head = 8
        if size == 1 and at + 16 <= len(data):
            size, head = struct.unpack_from(">Q", data, at + 8)[0], 16
        size = size or len(data) - at
        if size < head or size > len(data) - at:
            return
        yield name, data[at + head : at + size]
        at += size


def _box(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body) + 8) + name + body
