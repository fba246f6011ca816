"""ICC profiles of RGB, version 2.4 (ICC.1:2001-04): the bytes of a file, and the profile of Adobe RGB (1998).

Cameras state Adobe RGB in EXIF tags alone, which programs that write files lose.
"""

import struct
from collections.abc import Mapping
from functools import cache

from lutforge.colour.rgb_spaces import D50_XYZ

ADOBE_RGB_NAME = "Compatible with Adobe RGB (1998)"


@cache
def adobe_rgb_profile() -> bytes:
    """The profile of Adobe RGB (1998): a matrix and one curve."""
    curve = struct.pack(">4s4xIHxx", b"curv", 1, round(256 * 2.19921875))
    # XYZ of red, green and blue, adapted to D50 (Adobe RGB (1998) Color Image Encoding, 4.3).
    primaries = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
    tags = {
        b"wtpt": icc_xyz((0.95045, 1.0, 1.08905)),
        **{name: icc_xyz(colour) for name, colour in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)},
        **dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve),
    }
    return icc_file(b"mntr", b"XYZ ", ADOBE_RGB_NAME, "No copyright, use freely", tags)


def icc_file(kind: bytes, connection: bytes, name: str, copyright_: str, tags: Mapping[bytes, bytes]) -> bytes:
    """The bytes of a profile.

    kind: the profile's class, such as b"mntr"; connection: its connection space; tags: data by signature, after those
    of the name and the copyright.
    """
    text = name.encode("ascii", "replace") + b"\0"
    tags = {
        b"desc": struct.pack(">4s4xI", b"desc", len(text)) + text + bytes(78),
        b"cprt": struct.pack(">4s4x", b"text") + copyright_.encode() + b"\0",
        **tags,
    }

    # The table of tags: signature, offset and length of each.
    start = 132 + 12 * len(tags)
    table = body = b""
    for tag, data in tags.items():
        table += struct.pack(">4sII", tag, start + len(body), len(data))
        body += data + bytes(-len(data) % 4)

    date = (2026, 1, 1, 0, 0, 0)  # of no meaning: the same numbers give the same file
    head = struct.pack(">I4xI4s4s4s6H4s", start + len(body), 0x02400000, kind, b"RGB ", connection, *date, b"acsp")
    return head + bytes(28) + icc_xyz(D50_XYZ)[8:] + bytes(48) + struct.pack(">I", len(tags)) + table + body


def icc_xyz(values: tuple[float, float, float]) -> bytes:
    """XYZ as a tag's data (XYZType)."""
    return struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * value) for value in values))
