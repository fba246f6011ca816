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

_GAIN_MAP, _ITEMS, _CAMERA = range(3)
_NAMESPACES_OF = {
    _GAIN_MAP: (b"http://ns.adobe.com/hdr-gain-map/1.0/", b"http://ns.apple.com/HDRGainMap/1.0/"),
    _ITEMS: (b"http://ns.google.com/photos/1.0/container/",),
    _CAMERA: (b"http://ns.google.com/photos/1.0/camera/",),
}
_USUAL_PREFIXES = {
    _GAIN_MAP: (b"hdrgm", b"HDRGainMap"),
    _ITEMS: (b"Container",),
    _CAMERA: (b"GCamera", b"Camera", b"OpCamera", b"MiCamera"),
}
"""Prefixes that packets use, some without a declaration."""
_LOCAL_NAMES = {_GAIN_MAP: rb"\w+", _ITEMS: b"Directory", _CAMERA: rb"(?:MotionPhoto|MicroVideo)\w*"}
"""The properties of each namespace that declare a gain map, a list of items behind the picture, and a film."""
_DECLARATION = re.compile(rb"\bxmlns:(\w+)\s*=\s*(?:\"([^\"]*)\"|'([^']*)')")

_EXTENSION_CHECKSUM = re.compile(rb"HasExtendedXMP(?:\s*=\s*[\"']|>)([0-9A-F]{32})")
_NAMES_IT = re.compile(
    rb"(?<!\s)\s+xmpNote:HasExtendedXMP\s*=\s*(\"[^\"]*\"|'[^']*')|<(xmpNote:HasExtendedXMP)>[^<]*</\2>"
)
_START, _END = re.compile(rb"<rdf:RDF\b([^>]*)>"), b"</rdf:RDF>"
_NAMESPACES = re.compile(rb"\bxmlns:(\w+)")


def without_further_pictures(xmp: bytes) -> bytes:
    """An XMP packet that declares no gain map, film or other item behind the picture (Ultra HDR, motion photos)."""
    for kind in (_GAIN_MAP, _CAMERA, _ITEMS):
        xmp = _without_elements(_attribute(xmp, kind).sub(b"", xmp), kind)
    return xmp


def declares_film(xmp: bytes) -> bool:
    """True where an XMP packet declares that a film follows the picture."""
    return bool(_attribute(xmp, _CAMERA).search(xmp)) or _without_elements(xmp, _CAMERA) != xmp


def _names(xmp: bytes, kind: int) -> bytes:
    """A pattern of the names that properties of a kind have in a packet, by the prefixes that it declares."""
    declared = {prefix for prefix, *space in _DECLARATION.findall(xmp) if b"".join(space) in _NAMESPACES_OF[kind]}
    prefixes = b"|".join(sorted(declared.union(_USUAL_PREFIXES[kind])))
    return rb"(?:" + prefixes + rb"):" + _LOCAL_NAMES[kind] + rb"(?![\w.-])"


# A packet is padded with tens of thousands of spaces, and an untrusted one may repeat anything. Therefore each pattern
# reads a byte only a fixed number of times: with (?<!\s), a match begins only at the first space of a run.
def _attribute(xmp: bytes, kind: int) -> re.Pattern[bytes]:
    """The pattern of properties that are attributes, with the spaces before them."""
    return re.compile(rb"(?<!\s)\s+" + _names(xmp, kind) + rb"\s*=\s*(\"[^\"]*\"|'[^']*')")


def _without_elements(xmp: bytes, kind: int) -> bytes:
    """A packet without the properties of a kind that are elements; one that does not end stays."""
    kept, start, name = [0], 0, b""
    for tag in re.finditer(rb"<(/?)(" + _names(xmp, kind) + rb")[^<>]*>", xmp):
        is_end, is_whole = bool(tag[1]), tag[0].endswith(b"/>")
        if not is_end and not name:
            start, name = tag.start(), tag[2]
        if name == tag[2] and (is_end or (is_whole and start == tag.start())):
            kept += [start, tag.end()]
            name = b""
    ends = [*kept[1:], len(xmp)]
    return b"".join(xmp[first:last] for first, last in zip(kept[::2], ends[::2], strict=True))


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
