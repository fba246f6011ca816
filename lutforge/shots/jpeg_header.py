"""Size and component count of a JPEG, read before anything is decoded, and its EXIF block."""

from dataclasses import dataclass

from lutforge.errors import ImageError

MAX_PIXELS = 400_000_000

_FRAME_MARKERS = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}
_STANDALONE = frozenset([0x01, *range(0xD0, 0xD9)])


@dataclass(frozen=True)
class JpegHeader:
    """exif: the TIFF structure of the first EXIF segment, empty where there is none."""

    width: int
    height: int
    components: int
    exif: bytes


def read_jpeg_header(data: bytes, source: str) -> JpegHeader:
    """Walk the segments up to the frame header (ITU-T T.81, B.1). Raises ImageError where it is not a sane
    JPEG."""
    if data[:2] != b"\xff\xd8":
        raise ImageError(f"{source}: not a JPEG file")
    position, exif = 2, b""
    while position + 4 <= len(data):
        if data[position] != 0xFF:
            break
        marker = data[position + 1]
        if marker == 0xFF:  # fill byte
            position += 1
            continue
        if marker in _STANDALONE:
            position += 2
            continue
        length = int.from_bytes(data[position + 2 : position + 4], "big")
        body = data[position + 4 : position + 2 + length]
        if length < 2 or marker in (0xD9, 0xDA):
            break
        if marker == 0xE1 and body[:6] == b"Exif\0\0" and not exif:
            exif = body[6:]
        if marker in _FRAME_MARKERS and len(body) >= 6:
            height, width = int.from_bytes(body[1:3], "big"), int.from_bytes(body[3:5], "big")
            if height < 1 or width < 1 or height * width > MAX_PIXELS:
                raise ImageError(f"{source}: a JPEG that claims {width}×{height} pixels")
            return JpegHeader(width, height, body[5], exif)
        position += 2 + length
    raise ImageError(f"{source}: a damaged JPEG: no frame header")
