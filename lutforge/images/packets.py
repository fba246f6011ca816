"""Packets of metadata as a file stores them: read of any format, written where OpenImageIO writes none.

XMP, IPTC and EXIF, of JPEG (segments), PNG (chunks), WebP (RIFF chunks), JPEG 2000 (boxes), TIFF (fields) and HEIF. A
damaged file has no packets.
"""

import struct
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from mmap import ACCESS_READ, mmap
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.boundary import reading
from lutforge.errors import ImageError
from lutforge.images.heif import is_heif, read_heif_description
from lutforge.images.jpeg import APP0, APP1, EXIF, SOI, Segment, metadata_end, read_header
from lutforge.images.stated_encoding import of_codes, of_gamma_and_primaries
from lutforge.images.tiff import byte_order, number, offset_in, read_directory
from lutforge.images.xmp import EXTENSION, XMP_SEGMENT, extended_segments, with_extension

_PNG, _JP2 = b"\x89PNG\r\n\x1a\n", b"\0\0\0\x0cjP  \r\n\x87\n"
_PNG_XMP = b"XML:com.adobe.xmp\0"
_UUID_EXIF, _UUID_XMP = b"JpgTiffExif->JP2", bytes.fromhex("be7acfcb97a942e89c71999491e3afac")
_UUID_IPTC = bytes.fromhex("33c7a4d2b81d4723a0baf1a3e097ad38")
_TIFF_XMP, _TIFF_IPTC = 700, 33723
_MAKER_NOTE, _USER_COMMENT = 0x927C, 0x9286
_PNG_IPTC = b"Raw profile type iptc\0"
"""Keyword of the text in which ImageMagick and exiftool store IPTC in a PNG, which has no place for it."""
PHOTOSHOP = (0xED, b"Photoshop 3.0\0")
"""Marker and beginning of the JPEG segments that hold Photoshop's image resources, IPTC among them."""
_RESOURCE, _IPTC_RESOURCE = b"8BIM", 0x0404
LARGEST_JPEG_PACKET = 65_000
"""Bytes of a packet that a segment of a JPEG holds, beside its signature; XMP beyond them gets segments more."""
_LARGEST = 1 << 24
"""Bytes of a packet that is read."""


@dataclass(frozen=True)
class Packets:
    """What a file stores besides its pixels.

    xmp, iptc, exif: packets as the file has them, empty where there are none; exif of a JPEG 2000 alone, in which
    OpenImageIO does not look for it. animated: several frames. lossless: a WebP without loss. extended: an XMP packet
    of a JPEG has an extension beyond 64 kB, which is not in `xmp`, since it is damaged. encoding: what a PNG or HEIF
    without an ICC profile states of its own that is not sRGB. not_described: what its EXIF has that no description of
    OpenImageIO holds.
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
    """Read what a picture's file stores; nothing of a damaged one or another format."""
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
    if data[:2] == b"\xff\xd8":
        return _jpeg_packets(data)
    if data[:8] == _PNG:
        return _png_packets(data)
    if data[:4] == b"RIFF" and data[8:12] == b"WEBP":
        chunks = dict(reversed(list(_records(data, 12, _riff_chunk))))
        xmp, exif = (data[chunks.get(name, slice(0))] for name in (b"XMP ", b"EXIF"))
        missing = _not_described(exif.removeprefix(EXIF[1]))
        return Packets(xmp, animated=b"ANIM" in chunks, lossless=b"VP8L" in chunks, not_described=missing)
    if data[:12] == _JP2:
        bodies = [data[place] for name, place in _records(data, 0, _box_at) if name == b"uuid"]
        packets = {body[:16]: body[16:] for body in reversed(bodies)}  # the first of a kind counts
        xmp, iptc, exif = (packets.get(kind, b"") for kind in (_UUID_XMP, _UUID_IPTC, _UUID_EXIF))
        return Packets(xmp, iptc, exif, not_described=_not_described(exif))
    order = byte_order(data[:2])
    if order is not None and data[2:4] == struct.pack(f"{order}H", 42):
        entries, _ = read_directory(data, order, number(data, order, "I", 4))
        xmp, iptc = (data[entries[tag].place] if tag in entries else b"" for tag in (_TIFF_XMP, _TIFF_IPTC))
        return Packets(xmp, iptc, not_described=_not_described(data))
    return Packets()


def _jpeg_packets(data: bytes | mmap) -> Packets:
    header = read_header(data)
    segments = () if header is None else header.segments
    xmp = [segment.body[len(XMP_SEGMENT) :] for segment in segments if segment.holds((APP1, XMP_SEGMENT))]
    resources = b"".join(segment.body[len(PHOTOSHOP[1]) :] for segment in segments if segment.holds(PHOTOSHOP))
    whole = xmp[0] if xmp else b""
    extended = any(segment.holds(EXTENSION) for segment in segments)
    if extended and (joined := with_extension(whole, segments)) is not None:
        whole, extended = joined, False
    missing = _not_described(b"" if header is None or header.exif is None else header.exif)
    return Packets(whole, _iptc_of(resources), extended=extended, not_described=missing)


def _png_packets(data: bytes | mmap) -> Packets:
    xmp = iptc = b""
    chunks = [(name, place) for name, place in _records(data, 8, _png_chunk) if place.stop - place.start <= _LARGEST]
    for name, place in chunks:
        if name not in (b"iTXt", b"zTXt", b"tEXt"):
            continue
        body = data[place]
        if name == b"iTXt" and body.startswith(_PNG_XMP) and not xmp:
            # compressed or not, the method, two texts that end in a null
            packed, body_text = body[len(_PNG_XMP)] == 1, body[len(_PNG_XMP) + 2 :].split(b"\0", 2)[-1]
            xmp = _unpacked(body_text) if packed else body_text
        elif name != b"iTXt" and body.startswith(_PNG_IPTC) and not iptc:
            text = body[len(_PNG_IPTC) :] if name == b"tEXt" else _unpacked(body[len(_PNG_IPTC) + 1 :])
            # a line with a name, one with the length, and hexadecimal digits
            iptc = _iptc_of(bytes.fromhex(b"".join(text.split()[3:]).decode("ascii")))
    animated = any(name == b"acTL" for name, _ in chunks)
    colours = {name: data[place] for name, place in chunks if name in (b"cICP", b"iCCP", b"sRGB", b"gAMA", b"cHRM")}
    exif = next((data[place] for name, place in chunks if name == b"eXIf"), b"")
    encoding = _png_encoding(colours)
    return Packets(xmp, iptc, animated=animated, encoding=encoding, not_described=_not_described(exif))


def _not_described(block: bytes | mmap) -> tuple[str, ...]:
    """What a TIFF structure of EXIF has that is of no type which OpenImageIO reads (Exif 2.32, 4.6.5)."""
    order = byte_order(block[:2])
    if order is None or len(block) < 8:
        return ()
    try:
        first, _ = read_directory(block, order, number(block, order, "I", 4))
        place = offset_in(block, order, first, 0x8769)
        photo, _ = ({}, 0) if place is None else read_directory(block, order, place)
    except struct.error:  # an offset beyond the end
        return ()
    comment = block[photo[_USER_COMMENT].place] if _USER_COMMENT in photo else b""
    # Cameras write an empty one: eight bytes of a character set, then blanks.
    written = bool(comment[8:].strip(b" \0"))
    return (*(["maker notes"] if _MAKER_NOTE in photo else []), *(["the user comment of EXIF"] if written else []))


def _unpacked(text: bytes) -> bytes:
    return zlib.decompressobj().decompress(text, _LARGEST)


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
    """What a PNG states of its encoding: by cICP, else iCCP, sRGB, gAMA and cHRM, in this order (PNG 3, 4.3)."""
    if len(codes := chunks.get(b"cICP", b"")) == 4:
        return of_codes(codes[0], codes[1], codes[3] != 0)
    if b"iCCP" in chunks or b"sRGB" in chunks:
        return ""
    gamma, corners = chunks.get(b"gAMA", b""), chunks.get(b"cHRM", b"")
    exponent = number(gamma, ">", "I", 0) / 100_000 if len(gamma) == 4 else 0.0
    stated = tuple(value / 100_000 for value in struct.unpack(">8I", corners)) if len(corners) == 32 else ()
    return of_gamma_and_primaries(exponent, stated)


def read_heif_packets(path: Path) -> Packets:
    """What a HEIF file stores: XMP, and the code points of its colours. Raises ImageError as `read_heif`."""
    described = read_heif_description(path)
    primaries = 0 if described.icc else described.primaries
    encoding = of_codes(primaries, described.transfer)
    return Packets(described.xmp, encoding=encoding, not_described=_not_described(described.exif))


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


def holds_packets(format: str) -> frozenset[str]:
    """The kinds of packets, XMP and IPTC, that are written to a format, by OpenImageIO's name of it."""
    if format in ("jpeg", "tiff", "jpeg2000"):
        return frozenset({"XMP", "IPTC"})
    return frozenset({"XMP"} if format in ("png", "webp", "openexr") else ())


def add_packets(path: Path, format: str, spec: oiio.ImageSpec, xmp: bytes, iptc: bytes) -> None:
    """Put XMP into a JPEG, TIFF, PNG, WebP or JPEG 2000 that OpenImageIO wrote, and IPTC where `holds_packets`.

    The last two get EXIF, too. A JPEG holds IPTC of up to LARGEST_JPEG_PACKET.
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
        path.write_bytes(data[:33] + chunk + data[33:])  # behind IHDR
    elif format == "webp":
        path.write_bytes(_webp_with(data, spec, exif_block(spec), xmp))
    elif format == "jpeg2000" and data[:12] == _JP2:
        profile = spec.getattribute("ICCProfile")
        uuids = [(b"uuid", _UUID_EXIF + exif_block(spec)), (b"uuid", _UUID_XMP + xmp), (b"uuid", _UUID_IPTC + iptc)]
        added = b"".join(_box(name, body) for name, body in uuids if len(body) > 16)
        parts = []
        for name, place in _records(data, 0, _box_at):
            body = data[place]
            if name == b"jp2h" and profile is not None:
                colour = _box(b"colr", b"\2\0\0" + bytes(profile))
                boxes = _records(body, 0, _box_at)
                body = b"".join(colour if kind == b"colr" else _box(kind, body[part]) for kind, part in boxes)
            if name == b"jp2c":
                parts.append(added)
            parts.append(_box(name, body))
        path.write_bytes(b"".join(parts))


def photoshop_segment(iptc: bytes) -> Segment:
    """The segment of a JPEG that holds an IPTC packet."""
    resource = struct.pack(">4sHHI", _RESOURCE, _IPTC_RESOURCE, 0, len(iptc)) + iptc + bytes(len(iptc) % 2)
    return Segment(PHOTOSHOP[0], PHOTOSHOP[1] + resource)


def _jpeg_with(data: bytes, xmp: bytes, iptc: bytes) -> bytes:
    """A JPEG file with packets in place of those that OpenImageIO wrote; IPTC that is too large is not written."""
    header = read_header(data)
    added: list[Segment] = []
    replaced = []
    if xmp:
        fits = len(xmp) < LARGEST_JPEG_PACKET
        added += [Segment(APP1, XMP_SEGMENT + xmp)] if fits else extended_segments(xmp)
        replaced.append((APP1, XMP_SEGMENT))
    if 0 < len(iptc) < LARGEST_JPEG_PACKET:
        added.append(photoshop_segment(iptc))
        replaced.append(PHOTOSHOP)
    if header is None or not added:
        return data
    segments = [segment for segment in header.segments if not any(segment.holds(kind) for kind in replaced)]
    places = [at + 1 for at, segment in enumerate(segments) if segment.marker == APP0 or segment.holds(EXIF)]
    place = max(places, default=0)
    segments[place:place] = added
    return SOI + b"".join(segment.stored for segment in segments) + data[metadata_end(data) :]


def _put_into_tiff(path: Path, fields: Mapping[int, bytes]) -> None:
    """Write the first directory anew, at the end of the file, with packets by tag; BigTIFF files stay as they are."""
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
            kind = 1 if tag == _TIFF_XMP else 7  # bytes, or what is not defined
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
    """A WebP file with chunks more (WebP Container Specification, extended format)."""
    chunks = [(name, data[place]) for name, place in _records(data, 12, _riff_chunk) if name not in (b"EXIF", b"XMP ")]
    flags = dict(chunks).get(b"VP8X", b"\0")[0] | (8 if exif else 0) | (4 if xmp else 0)
    flags |= 16 if spec.alpha_channel >= 0 else 0
    size = struct.pack("<I", spec.width - 1)[:3] + struct.pack("<I", spec.height - 1)[:3]
    chunks = [(b"VP8X", bytes([flags, 0, 0, 0]) + size), *((n, b) for n, b in chunks if n != b"VP8X")]
    chunks += [(name, body) for name, body in ((b"EXIF", exif), (b"XMP ", xmp)) if body]
    whole = b"".join(name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2) for name, body in chunks)
    return b"RIFF" + struct.pack("<I", len(whole) + 4) + b"WEBP" + whole


def _records(
    data: bytes | mmap, at: int, record: Callable[[bytes | mmap, int], tuple[bytes, slice, int]]
) -> Iterator[tuple[bytes, slice]]:
    """The records that follow each other from a place on, as names and places of their bodies, up to a damaged one.

    record: the name of the one at a place, where its body lies, and where the next one begins.
    """
    while at + 8 <= len(data):
        name, body, following = record(data, at)
        if not at + 8 <= body.start <= body.stop <= min(following, len(data)):
            return
        yield name, body
        at = following


def _png_chunk(data: bytes | mmap, at: int) -> tuple[bytes, slice, int]:
    length, name = struct.unpack_from(">I4s", data, at)
    return name, slice(at + 8, at + 8 + length), at + 12 + length  # a checksum follows


def _riff_chunk(data: bytes | mmap, at: int) -> tuple[bytes, slice, int]:
    name, length = struct.unpack_from("<4sI", data, at)
    return name, slice(at + 8, at + 8 + length), at + 8 + length + length % 2


def _box_at(data: bytes | mmap, at: int) -> tuple[bytes, slice, int]:
    size, name = struct.unpack_from(">I4s", data, at)
    head = 8
    if size == 1 and at + 16 <= len(data):
        size, head = number(data, ">", "Q", at + 8), 16
    end = at + size if size else len(data)
    return name, slice(at + head, end), end


def _box(name: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body) + 8) + name + body
