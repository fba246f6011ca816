"""XMP packets: further pictures and films that they declare, and the two parts of a packet beyond 64 kB in a JPEG.

By the XMP Specification, Part 3 (2020), 1.1.3, the packet in a JPEG's first segment names an extension by a checksum.
The extension is a packet itself, and further segments hold it in pieces.
"""

import hashlib
import re
import struct
from collections.abc import Sequence

from lutforge.images.jpeg import APP1, Segment

XMP_SEGMENT = b"http://ns.adobe.com/xap/1.0/\0"
"""Beginning of the JPEG segment that holds a packet."""

EXTENSION = (APP1, b"http://ns.adobe.com/xmp/extension/\0")
"""Marker and beginning of the JPEG segments that hold the pieces of an extension."""

_PIECE = 65_000
"""Bytes of an extension in one segment; the specification allows 65,458."""

_LARGEST_EXTENSION = 1 << 24
"""Bytes of an extension that is read."""

# A packet is padded with tens of thousands of spaces, and an untrusted one may repeat anything. Therefore each pattern
# reads a byte only a fixed number of times: with (?<!\s), a match begins only at the first space of a run.
_GAIN_MAP = re.compile(rb"(?<!\s)\s+hdrgm:\w+\s*=\s*(\"[^\"]*\"|'[^']*')")
_MOTION = re.compile(
    rb"(?<!\s)\s+(?:GCamera|Camera|OpCamera|MiCamera):(?:MotionPhoto|MicroVideo)\w*\s*=\s*(\"[^\"]*\"|'[^']*')"
)
_MOTION_ELEMENT = re.compile(rb"<((?:GCamera|Camera):(?:MotionPhoto|MicroVideo)\w*)>[^<]*</\1>")
_DIRECTORY = re.compile(rb"<Container:Directory\b.*?</Container:Directory\s*>", re.DOTALL)
_DIRECTORY_END = re.compile(rb"</Container:Directory\s*>")

_EXTENSION_CHECKSUM = re.compile(rb"HasExtendedXMP(?:\s*=\s*[\"']|>)([0-9A-F]{32})")
_NAMES_IT = re.compile(
    rb"(?<!\s)\s+xmpNote:HasExtendedXMP\s*=\s*(\"[^\"]*\"|'[^']*')|<(xmpNote:HasExtendedXMP)>[^<]*</\2>"
)
_START, _END = re.compile(rb"<rdf:RDF\b([^>]*)>"), b"</rdf:RDF>"
_NAMESPACES = re.compile(rb"\bxmlns:(\w+)")


def without_further_pictures(xmp: bytes) -> bytes:
    """An XMP packet that declares no gain map, film or other item behind the picture (Ultra HDR, motion photos)."""
    for declared in (_GAIN_MAP, _MOTION, _MOTION_ELEMENT):
        xmp = declared.sub(b"", xmp)

    # The search for lists stops at the end of the last one: after it, it would read the rest of the packet in vain.
    list_ends = [end.end() for end in _DIRECTORY_END.finditer(xmp)]
    last = list_ends[-1] if list_ends else 0
    return _DIRECTORY.sub(b"", xmp[:last]) + xmp[last:]


def declares_film(xmp: bytes) -> bool:
    """True where an XMP packet declares that a film follows the picture."""
    return bool(_MOTION.search(xmp) or _MOTION_ELEMENT.search(xmp))


def with_extension(xmp: bytes, segments: Sequence[Segment]) -> bytes | None:
    """A packet of a JPEG joined with its extension; None where the extension is damaged or cannot be joined.

    Both are lists of descriptions of one picture (rdf:RDF): those of the extension follow those of the packet.
    """
    named = _EXTENSION_CHECKSUM.search(xmp)
    extension = _joined(named[1], segments) if named is not None else None
    if extension is None:
        return None
    start, last = _START.search(extension), extension.rfind(_END)
    end = xmp.rfind(_END)

    # Namespaces that the extension declares outside of its descriptions would be lost, since only these are kept.
    if start is None or last < start.end() or end < 0 or set(_NAMESPACES.findall(start[1])) - {b"rdf"}:
        return None
    return _NAMES_IT.sub(b"", xmp[:end]) + extension[start.end() : last] + xmp[end:]


def _joined(name: bytes, segments: Sequence[Segment]) -> bytes | None:
    """The extension of a name from its pieces; None where some are missing or its checksum is another one."""
    head = len(EXTENSION[1])
    whole = bytearray()
    for segment in sorted(
        (segment for segment in segments if segment.holds(EXTENSION) and segment.body[head : head + 32] == name),
        key=lambda segment: segment.body[head + 36 : head + 40],
    ):
        whole += segment.body[head + 40 :]
        if len(whole) > _LARGEST_EXTENSION:
            return None
    return bytes(whole) if _name_of(whole) == name else None


def extended_segments(xmp: bytes) -> list[Segment]:
    """The segments of a JPEG for a packet that one segment cannot hold: one that names it, and its pieces."""
    name = _name_of(xmp)
    packet = (
        b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        b'<rdf:Description rdf:about="" xmlns:xmpNote="http://ns.adobe.com/xmp/note/" '
        b'xmpNote:HasExtendedXMP="' + name + b'"/></rdf:RDF></x:xmpmeta>'
    )
    pieces = [
        Segment(APP1, EXTENSION[1] + name + struct.pack(">II", len(xmp), at) + xmp[at : at + _PIECE])
        for at in range(0, len(xmp), _PIECE)
    ]
    return [Segment(APP1, XMP_SEGMENT + packet), *pieces]


def _name_of(extension: bytes | bytearray) -> bytes:
    """The name of an extension: its MD5 checksum in capital letters."""
    return hashlib.md5(extension, usedforsecurity=False).hexdigest().upper().encode()
