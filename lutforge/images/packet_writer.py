"""Packets of metadata, written where OpenImageIO writes none: XMP, IPTC and EXIF."""

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.atomic_write import scratch_folder
from lutforge.images.chunks import JP2_SIGNATURE, PNG_SIGNATURE, box, box_at, chunks_of, png_chunk, riff_chunk
from lutforge.images.iptc import PHOTOSHOP, photoshop_segment
from lutforge.images.jpeg import APP0, APP1, EXIF, SOI, Segment, metadata_end, read_header
from lutforge.images.packets import PNG_XMP, TIFF_IPTC, TIFF_XMP, UUID_EXIF, UUID_IPTC, UUID_XMP
from lutforge.images.tiff import byte_order, number
from lutforge.images.xmp import XMP_SEGMENT, extended_segments

LARGEST_JPEG_PACKET = 65_000
"""Bytes of a packet that one segment of a JPEG holds, after its signature; longer XMP gets further segments."""


def holds_packets(format: str) -> frozenset[str]:
    """The kinds of packets, XMP and IPTC, that are written to a format, by OpenImageIO's name of it."""
    if format in ("jpeg", "tiff", "jpeg2000"):
        return frozenset({"XMP", "IPTC"})
    return frozenset({"XMP"} if format in ("png", "webp", "openexr") else ())


def add_packets(path: Path, format: str, spec: oiio.ImageSpec, xmp: bytes, iptc: bytes) -> None:
    """Put packets into a file that OpenImageIO wrote: XMP and IPTC, as far as `holds_packets` names them.

    A WebP and a JPEG 2000 get EXIF, too. A JPEG holds IPTC of up to LARGEST_JPEG_PACKET. Other formats stay as they
    are: those that have no place for packets, and OpenEXR, in which OpenImageIO writes XMP.
    """
    match format:
        case "tiff":
            if fields := {tag: packet for tag, packet in ((TIFF_XMP, xmp), (TIFF_IPTC, iptc)) if packet}:
                _put_into_tiff(path, fields)
        case "jpeg":
            path.write_bytes(_jpeg_with(path.read_bytes(), xmp, iptc))
        case "png":
            data = path.read_bytes()
            described = _png_with(data, xmp)
            if described != data:
                path.write_bytes(described)
        case "webp":
            path.write_bytes(_webp_with(path.read_bytes(), spec, exif_block(spec), xmp))
        case "jpeg2000":
            data = path.read_bytes()
            if data[:12] == JP2_SIGNATURE:
                path.write_bytes(_jp2_with(data, spec, exif_block(spec), xmp, iptc))


def _png_with(data: bytes, xmp: bytes) -> bytes:
    """A PNG file with an XMP packet, uncompressed, after its first chunk, IHDR, and with texts in their encoding.

    A tEXt chunk is Latin-1, but OpenImageIO writes UTF-8 into it: texts beyond ASCII become iTXt chunks, of UTF-8.
    """
    parts = [data[: len(PNG_SIGNATURE)]]
    end = len(PNG_SIGNATURE)
    for name, place in chunks_of(data, len(PNG_SIGNATURE), png_chunk):
        end = place.stop + 4
        keyword, _, text = data[place].partition(b"\0")
        if name == b"tEXt" and not text.isascii() and _is_utf8(text):
            parts.append(_png_chunk(b"iTXt", keyword + bytes(5) + text))
        else:
            parts.append(data[place.start - 8 : end])
        if name == b"IHDR" and xmp:
            parts.append(_png_chunk(b"iTXt", PNG_XMP + bytes(4) + xmp))
    return b"".join(parts) + data[end:]


def _png_chunk(name: bytes, body: bytes) -> bytes:
    """The bytes of a chunk of a PNG."""
    return struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body))


def _is_utf8(text: bytes) -> bool:
    """True where bytes are text in UTF-8."""
    try:
        text.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _jp2_with(data: bytes, spec: oiio.ImageSpec, exif: bytes, xmp: bytes, iptc: bytes) -> bytes:
    """A JPEG 2000 file with packets before its pixels, and with the ICC profile of its description."""
    profile = spec.getattribute("ICCProfile")
    uuids = [UUID_EXIF + exif, UUID_XMP + xmp, UUID_IPTC + iptc]
    packets = b"".join(box(b"uuid", body) for body in uuids if len(body) > 16)  # a kind alone has 16 bytes
    parts = []
    for name, place in chunks_of(data, 0, box_at):
        body = data[place]
        if name == b"jp2h" and profile is not None:
            colour = box(b"colr", b"\2\0\0" + bytes(profile))
            boxes = chunks_of(body, 0, box_at)
            body = b"".join(colour if kind == b"colr" else box(kind, body[part]) for kind, part in boxes)
        if name == b"jp2c":  # the pixels
            parts.append(packets)
        parts.append(box(name, body))
    return b"".join(parts)


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

        # The first directory: the number of its fields, fields of 12 bytes, and the offset of the next directory.
        file.seek(number(head, order, "I", 4))
        count = number(file.read(2), order, "H", 0)
        entries = [file.read(12) for _ in range(count)]
        following = file.read(4)

        # The packets go to even offsets from the end of the file on, and their fields into the directory.
        end = file.seek(0, 2)
        added = bytes(end % 2)
        entries = [entry for entry in entries if number(entry, order, "H", 0) not in fields]
        for tag, packet in fields.items():
            kind = 1 if tag == TIFF_XMP else 7  # the types BYTE and UNDEFINED
            entries.append(struct.pack(f"{order}HHII", tag, kind, len(packet), end + len(added)))
            added += packet + bytes(len(packet) % 2)

        # Then comes the directory, to which the header points from now on. Offsets have 32 bits.
        directory = end + len(added)
        if directory + 12 * len(entries) + 8 >= 1 << 32:
            return
        entries.sort(key=lambda entry: number(entry, order, "H", 0))
        file.write(added + struct.pack(f"{order}H", len(entries)) + b"".join(entries) + following)
        file.seek(4)
        file.write(struct.pack(f"{order}I", directory))


def _webp_with(data: bytes, spec: oiio.ImageSpec, exif: bytes, xmp: bytes) -> bytes:
    """A WebP file with chunks of EXIF and XMP (WebP Container Specification, extended format)."""
    chunks = [(name, data[place]) for name, place in chunks_of(data, 12, riff_chunk) if name not in (b"EXIF", b"XMP ")]

    # The first chunk, VP8X, has flags of the features and the size less 1, in 24 bits each.
    flags = dict(chunks).get(b"VP8X", b"\0")[0] | (8 if exif else 0) | (4 if xmp else 0)
    flags |= 16 if spec.alpha_channel >= 0 else 0
    size = struct.pack("<I", spec.width - 1)[:3] + struct.pack("<I", spec.height - 1)[:3]
    chunks = [(b"VP8X", bytes([flags, 0, 0, 0]) + size), *((n, b) for n, b in chunks if n != b"VP8X")]
    chunks += [(name, body) for name, body in ((b"EXIF", exif), (b"XMP ", xmp)) if body]
    whole = b"".join(name + struct.pack("<I", len(body)) + body + bytes(len(body) % 2) for name, body in chunks)
    return b"RIFF" + struct.pack("<I", len(whole) + 4) + b"WEBP" + whole


def exif_block(spec: oiio.ImageSpec) -> bytes:
    """The TIFF structure of EXIF, GPS included, that OpenImageIO writes of a description; empty where it has none."""
    small = oiio.ImageSpec(8, 8, 3, oiio.UINT8)
    for attribute in spec.extra_attribs:
        if attribute.name.startswith(("Exif:", "GPS:")) or ":" not in attribute.name:
            value = attribute.value
            if isinstance(value, str):  # OpenImageIO takes no bytes back that are no text
                value = value.encode("utf-8", "replace").decode("utf-8")
            if isinstance(value, int):  # which OpenImageIO drops where it is given as one of 16 bits
                small.attribute(attribute.name, value)
            else:
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
