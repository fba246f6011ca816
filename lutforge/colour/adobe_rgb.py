"""The ICC profile of Adobe RGB (1998): cameras tell so in EXIF tags alone, which programs that write files lose."""

import struct
from functools import cache

NAME = "Compatible with Adobe RGB (1998)"


@cache
def adobe_rgb_profile() -> bytes:
    """A matrix profile of version 2 (ICC.1:2001-04)."""
    text = NAME.encode() + b"\0"
    curve = struct.pack(">4s4xIHxx", b"curv", 1, round(256 * 2.19921875))
    # XYZ of red, green and blue, adapted to D50 (Adobe RGB (1998) Color Image Encoding, 4.3).
    primaries = ((0.60974, 0.31111, 0.01947), (0.20528, 0.62567, 0.06087), (0.14919, 0.06322, 0.74457))
    tags = {
        b"desc": struct.pack(">4s4xI", b"desc", len(text)) + text + bytes(78),
        b"cprt": struct.pack(">4s4x", b"text") + b"No copyright, use freely\0",
        b"wtpt": _xyz((0.95045, 1.0, 1.08905)),
        **{name: _xyz(colour) for name, colour in zip((b"rXYZ", b"gXYZ", b"bXYZ"), primaries, strict=True)},
        **dict.fromkeys((b"rTRC", b"gTRC", b"bTRC"), curve),
    }
    start, places, body = 132 + 12 * len(tags), b"", b""
    for name, data in tags.items():
        places += struct.pack(">4sII", name, start + len(body), len(data))
        body += data + bytes(-len(data) % 4)
    head = struct.pack(">I4xI4s4s4s12x4s", start + len(body), 0x02100000, b"mntr", b"RGB ", b"XYZ ", b"acsp")
    illuminant = _xyz((0.9642, 1.0, 0.8249))[8:]
    return head + bytes(28) + illuminant + bytes(48) + struct.pack(">I", len(tags)) + places + body


def _xyz(values: tuple[float, float, float]) -> bytes:
    return struct.pack(">4s4x3i", b"XYZ ", *(round(65536 * value) for value in values))
