"""Packets of metadata (XMP, IPTC, EXIF), read from image files, and written where OpenImageIO writes none.

JPEG stores them in segments, PNG in chunks, WebP in RIFF chunks, JPEG 2000 in boxes, TIFF in fields; of HEIF they are
read only. A damaged file counts as one without packets.
"""

import re
import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif, read_heif_xmp
from lutforge.images.jpeg import APP0, APP1, EXIF, SOI, Segment, metadata_end, read_header
from lutforge.images.tiff import byte_order, number, read_directory

XMP_SEGMENT = b"http://ns.adobe.com/xap/1.0/\0"
_PNG = b"\x89PNG\r\n\x1a\n"
_JP2 = b"\0\0\0\x0cjP  \r\n\x87\n"
_PNG_XMP = b"XML:com.adobe.xmp\0"
_UUID_EXIF = b"JpgTiffExif->JP2"
_UUID_XMP = bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
_UUID_IPTC = bytes.fromhex("33c7a4d2b81d4723a0baf1a3e097ad38")
_TIFF_XMP = 700
_TIFF_IPTC = 33723
_PNG_IPTC = b"Raw profile type iptc\0"
"""Keyword of the text in which ImageMagick and exiftool store IPTC in a PNG, whose format does not provide for it."""
PHOTOSHOP = (0xED, b"Photoshop 3.0\0")
"""Marker and beginning of the JPEG segments that hold Photoshop's image resources, IPTC among them."""
_XMP_EXTENSION = (APP1, b"http://ns.adobe.com/xmp/extension/\0")
_RESOURCE = b"8BIM"
_IPTC_RESOURCE = 0x0404
LARGEST_JPEG_PACKET = 65_000
"""Most bytes of a packet that a segment of a JPEG holds, its signature not counted."""
_LARGEST_READ = 1 << 24
"""Most bytes of a packet that is read."""

# A packet is padded with tens of thousands of spaces, and an untrusted one may repeat anything, so that each pattern
# must look at every byte only a fixed number of times: with (?<!\s) a match begins only at the first space of a run.
_GAIN_MAP = re.compile(rb"(?<!\s)\s+hdrgm:\w+\s*=\s*(\"[^\"]*\"|'[^']*')")
_MOTION = re.compile(
    rb"(?<!\s)\s+(?:GCamera|Camera|OpCamera|MiCamera):(?:MotionPhoto|MicroVideo)\w*\s*=\s*(\"[^\"]*\"|'[^']*')"
)
_MOTION_ELEMENT = re.compile(rb"<((?:GCamera|Camera):(?:MotionPhoto|MicroVideo)\w*)>[^<]*</\1>")
_DIRECTORY = re.compile(rb"<Container:Directory\b.*?</Container:Directory\s*>", re.DOTALL)
_DIRECTORY_END = re.compile(rb"</Container:Directory\s*>")


def without_further_pictures(xmp: bytes) -> bytes:
    """An XMP packet without the declarations of a gain map, film or other item after the picture.

    Ultra HDR and motion photos have such items.
    """
    for declared in (_GAIN_MAP, _MOTION, _MOTION_ELEMENT):
        xmp = declared.sub(b"", xmp)

    # Lists are searched only up to the last end of one: a list without an end would be searched for again and again.
    ends = [match.end() for match in _DIRECTORY_END.finditer(xmp)]
    last = ends[-1] if ends else 0
    return _DIRECTORY.sub(b"", xmp[:last]) + xmp[last:]


def declares_film(xmp: bytes) -> bool:
    """True where an XMP packet declares a film after the picture."""
    return bool(_MOTION.search(xmp) or _MOTION_ELEMENT.search(xmp))


@dataclass(frozen=True)
class Packets:
    """The metadata packets of an image file, and facts that its format states about it.

    xmp, iptc, exif: the packets, empty where there are none; exif only of JPEG 2000, where OpenImageIO does not read
    it. animated: the file has several frames. lossless: it is a lossless WebP. extended: the XMP packet of a JPEG has
    an extension beyond 64 kB, which is not in `xmp`. encoding: "PQ", "HLG" or "linear" where a PNG states it, else "".
    """

    xmp: bytes = b""
    iptc: bytes = b""
    exif: bytes = b""
    animated: bool = False
    lossless: bool = False
    extended: bool = False
    encoding: str = ""


def read_packets(path: Path) -> Packets:
    """Read the packets of an image file; those of a damaged file, or of another format, are empty."""
    try:
        if is_heif(path):
            return Packets(xmp=read_heif_xmp(path))
        with reading(path, "metadata", ImageError):
            if path.stat().st_size == 0:  # an empty file cannot be mapped
                return Packets()
            with path.open("rb") as file, mmap(file.fileno(), 0, access=ACCESS_READ) as data:
                return packets_of(data)
    except ImageError:
        return Packets()


def packets_of(data: bytes | mmap) -> Packets:
    """Read the packets in the bytes of a file. Damaged ones raise errors that `boundary.reading` translates."""
    if data[:2] == b"\xff\xd8":
        return _jpeg_packets(data)
    if data[:8] == _PNG:
        return _png_packets(list(_png_chunks(data)))
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        chunks = dict(reversed(list(_riff_chunks(data))))
        return Packets(chunks.get(b"XMP ", b""), animated=b"ANIM" in chunks, lossless=b"VP8L" in chunks)
    if data[:12] == _JP2:
        bodies = [body for name, body in _boxes(data) if name == b"uuid"]
        packets = {body[:16]: body[16:] for body in reversed(bodies)}  # the first of a kind counts
        xmp, iptc, exif = (packets.get(kind, b"") for kind in (_UUID_XMP, _UUID_IPTC, _UUID_EXIF))
        return Packets(xmp, iptc, exif)
    order = byte_order(data[:2])
    if order is not None and data[2:4] == struct.pack(f"{order}H", 42):
        entries, _ = read_directory(data, order, number(data, order, "I", 4))
        xmp, iptc = (data[entries[tag].place] if tag in entries else b"" for tag in (_TIFF_XMP, _TIFF_IPTC))
        return Packets(xmp, iptc)
    return Packets()


def _jpeg_packets(data: bytes | mmap) -> Packets:
    """The packets of a JPEG."""
    header = read_header(data)
    segments = () if header is None else header.segments
    xmp = [segment.body[len(XMP_SEGMENT) :] for segment in segments if segment.holds((APP1, XMP_SEGMENT))]
    resources = b"".join(segment.body[len(PHOTOSHOP[1]) :] for segment in segments if segment.holds(PHOTOSHOP))
    extended = any(segment.holds(_XMP_EXTENSION) for segment in segments)
    return Packets(xmp[0] if xmp else b"", _iptc_of(resources), extended=extended)


def _png_packets(chunks: list[tuple[bytes, bytes]]) -> Packets:
    """The packets of a PNG with these chunks (name, body)."""
    xmp = iptc = b""
    for name, body in chunks:
        if name == b"iTXt" and body.startswith(_PNG_XMP) and not xmp:
            # After the keyword: a byte for compressed or not, the method, two texts that end in a null, the packet.
            is_compressed = body[len(_PNG_XMP)] == 1
            packet = body[len(_PNG_XMP) + 2 :].split(b"\0", 2)[-1]
            xmp = _decompressed(packet) if is_compressed else packet
        elif name in (b"zTXt", b"tEXt") and body.startswith(_PNG_IPTC) and not iptc:
            text = body[len(_PNG_IPTC) :] if name == b"tEXt" else _decompressed(body[len(_PNG_IPTC) + 1 :])
            # A line with a name, one with the length, and hexadecimal digits.
            iptc = _iptc_of(bytes.fromhex(b"".join(text.split()[3:]).decode("ascii")))
    animated = any(name == b"acTL" for name, _ in chunks)
    return Packets(xmp, iptc, animated=animated, encoding=_png_encoding(dict(chunks)))


def _decompressed(text: bytes) -> bytes:
    """The decompressed text of a PNG chunk, its first _LARGEST_READ bytes."""
    return zlib.decompressobj().decompress(text, _LARGEST_READ)


def _iptc_of(resources: bytes) -> bytes:
    """The IPTC packet among Photoshop's image resources; empty where there is none.

    A resource is a signature, a number, a name and its data, both of even length
    (https://www.adobe.com/devnet-apps/photoshop/fileformatashtml/, Image Resources Section).
    """
    at = 0
    while resources[at : at + 4] == _RESOURCE:
        kind = number(resources, ">", "H", at + 4)
        start = at + 6 + (resources[at + 6] + 2) // 2 * 2
        size = number(resources, ">", "I", start)
        if kind == _IPTC_RESOURCE:
            return resources[start + 4 : start + 4 + size]
        at = start + 4 + size + size % 2
    return b""


def _png_encoding(chunks: dict[bytes, bytes]) -> str:
    """The encoding of a PNG, "" for a usual gamma; by its chunk cICP, else iCCP, sRGB or gAMA (PNG 3, 4.3)."""
    if (codes := chunks.get(b"cICP", b"")) and len(codes) == 4:
        return {8: "linear", 16: "PQ", 18: "HLG"}.get(codes[1], "")
    if b"iCCP" in chunks or b"sRGB" in chunks:
        return ""
    gamma = chunks.get(b"gAMA", b"")
    return "linear" if len(gamma) == 4 and struct.unpack(">I", gamma)[0] == 100_000 else ""


def exif_block(spec: oiio.ImageSpec) -> bytes:
    """The TIFF structure of EXIF and GPS that OpenImageIO writes for a description; empty where it has none."""
    small = oiio.ImageSpec(8, 8, 3, oiio.UINT8)
    for attribute in spec.extra_attribs:
        if attribute.name.startswith(("Exif:", "GPS:")) or ":" not in attribute.name:
            value = attribute.value
            if isinstance(value, str):  # OpenImageIO refuses bytes that are not text, although it reads them
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


def holds_packets(format: str) -> frozenset[str]:
    """The kinds of packets, XMP and IPTC, that are written to a format, by OpenImageIO's name of it."""
    if format in ("jpeg", "tiff", "jpeg2000"):
        return frozenset({"XMP", "IPTC"})
    return frozenset({"XMP"} if format in ("png", "webp", "openexr") else ())


def add_packets(path: Path, format: str, spec: oiio.ImageSpec, xmp: bytes, iptc: bytes) -> None:
    """Add XMP to a JPEG, TIFF, PNG, WebP or JPEG 2000 that OpenImageIO wrote, and IPTC where the format holds it.

    WebP and JPEG 2000 also get EXIF. A JPEG holds packets of up to LARGEST_JPEG_PACKET. format: see `holds_packets`.
    """
    if format == "tiff":
        if fields := {tag: packet for tag, packet in ((_TIFF_XMP, xmp), (_TIFF_IPTC, iptc)) if packet}:
            _put_into_tiff(path, fields)
        return
    if format not in ("jpeg", "png", "webp", "jpeg2000"):
        return
    data = path.read_bytes()
    if format == "jpeg":
        path.write_bytes(_jpeg_with(data, xmp, iptc))
    elif format == "png" and xmp:
        body = _PNG_XMP + bytes(4) + xmp
        chunk = struct.pack(">I", len(body)) + b"iTXt" + body + struct.pack(">I", zlib.crc32(b"iTXt" + body))
        path.write_bytes(data[:33] + chunk + data[33:])  # after the signature and the chunk IHDR
    elif format == "webp":
        path.write_bytes(_webp_with(data, spec, exif_block(spec), xmp))
    elif format == "jpeg2000" and data[:12] == _JP2:
        path.write_bytes(_jpeg2000_with(data, spec, xmp, iptc))


def _jpeg2000_with(data: bytes, spec: oiio.ImageSpec, xmp: bytes, iptc: bytes) -> bytes:
    """A JPEG 2000 file with the boxes of packets before its codestream, and with its description's ICC profile."""
    profile = spec.getattribute("ICCProfile")
    packets = [_UUID_EXIF + exif_block(spec), _UUID_XMP + xmp, _UUID_IPTC + iptc]
    added = b"".join(_box(b"uuid", body) for body in packets if len(body) > 16)
    parts = []
    for name, body in _boxes(data):
        if name == b"jp2h" and profile is not None:
            colour = _box(b"colr", b"\2\0\0" + bytes(profile))
            body = b"".join(colour if inner == b"colr" else _box(inner, part) for inner, part in _boxes(body))
        if name == b"jp2c":
            parts.append(added)
        parts.append(_box(name, body))
    return b"".join(parts)


def photoshop_segment(iptc: bytes) -> Segment:
    """The segment of a JPEG that holds an IPTC packet."""
    resource = struct.pack(">4sHHI", _RESOURCE, _IPTC_RESOURCE, 0, len(iptc)) + iptc + bytes(len(iptc) % 2)
    return Segment(PHOTOSHOP[0], PHOTOSHOP[1] + resource)


def _jpeg_with(data: bytes, xmp: bytes, iptc: bytes) -> bytes:
    """A JPEG file with packets in place of those that OpenImageIO wrote; a packet that is too large is left out."""
    header = read_header(data)
    packets = []
    if 0 < len(xmp) < LARGEST_JPEG_PACKET:
        packets.append(((APP1, XMP_SEGMENT), Segment(APP1, XMP_SEGMENT + xmp)))
    if 0 < len(iptc) < LARGEST_JPEG_PACKET:
        packets.append((PHOTOSHOP, photoshop_segment(iptc)))
    if header is None or not packets:
        return data
    segments = [segment for segment in header.segments if not any(segment.holds(kind) for kind, _ in packets)]
    places = [at + 1 for at, segment in enumerate(segments) if segment.marker == APP0 or segment.holds(EXIF)]
    place = max(places, default=0)
    segments[place:place] = [segment for _, segment in packets]
    return SOI + b"".join(segment.stored for segment in segments) + data[metadata_end(data) :]


def _put_into_tiff(path: Path, fields: Mapping[int, bytes]) -> None:
    """Write the first directory again, with packets by tag, at the end of the file; BigTIFF files stay as they are."""
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
        added = bytes(end % 2)
        entries = [entry for entry in entries if number(entry, order, "H", 0) not in fields]
        for tag, packet in fields.items():
            kind = 1 if tag == _TIFF_XMP else 7  # TIFF's types BYTE and UNDEFINED
            entries.append(struct.pack(f"{order}HHII", tag, kind, len(packet), end + len(added)))
            added += packet + bytes(len(packet) % 2)
        directory = end + len(added)
        if directory + 12 * len(entries) + 8 >= 1 << 32:
            return
        entries.sort(key=lambda entry: number(entry, order, "H", 0))
        file.write(added + struct.pack(f"{order}H", len(entries)) + b"".join(entries) + following)
        file.seek(4)
        file.write(struct.pack(f"{order}I", directory))


def _webp_with(data: bytes, spec: oiio.ImageSpec, exif: bytes, xmp: bytes) -> bytes:
    """A WebP file with chunks of EXIF and XMP (WebP Container Specification, extended format)."""
    chunks = [(name, body) for name, body in _riff_chunks(data) if name not in (b"EXIF", b"XMP ")]
    flags = dict(chunks).get(b"VP8X", b"\0")[0] | (8 if exif else 0) | (4 if xmp else 0)
    flags |= 16 if spec.alpha_channel >= 0 else 0
    size = struct.pack("<I", spec.width - 1)[:3] + struct.pack("<I", spec.height - 1)[:3]
    chunks = [(b"VP8X", bytes([flags, 0, 0, 0]) + size), *((n, b) for n, b in chunks if n != b"VP8X")]
    chunks += [(name, body) for name, body in ((b"EXIF", exif), (b"XMP ", xmp)) if body]
    content = b"".join(name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2) for name, body in chunks)
    return b"RIFF" + struct.pack("<I", len(content) + 4) + b"WEBP" + content


def _png_chunks(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    """The chunks (name, body) of a PNG, pixels and very large ones with an empty body."""
    at = 8
    while at + 12 <= len(data):
        length, name = struct.unpack_from(">I4s", data, at)
        if length > len(data) - at - 12:
            return
        yield name, b"" if name == b"IDAT" or length > _LARGEST_READ else data[at + 8 : at + 8 + length]
        at += 12 + length


def _riff_chunks(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    """The chunks (name, body) of a RIFF file."""
    at = 12
    while at + 8 <= len(data):
        name, length = struct.unpack_from("<4sI", data, at)
        if length > len(data) - at - 8:
            return
        yield name, data[at + 8 : at + 8 + length]
        at += 8 + length + length % 2


def _boxes(data: bytes | mmap) -> Iterator[tuple[bytes, bytes]]:
    """The boxes (name, body) of a JPEG 2000 file or of a box."""
    at = 0
    while at + 8 <= len(data):
        size, name = struct.unpack_from(">I4s", data, at)
        head = 8
        if size == 1 and at + 16 <= len(data):
            size = struct.unpack_from(">Q", data, at + 8)[0]
            head = 16
        size = size or len(data) - at
        if size < head or size > len(data) - at:
            return
        yield name, data[at + head : at + size]
        at += size


def _box(name: bytes, body: bytes) -> bytes:
    """A box of a JPEG 2000 file."""
    return struct.pack(">I", len(body) + 8) + name + body
