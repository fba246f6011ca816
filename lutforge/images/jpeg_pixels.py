"""The pixels of JPEG files, 8 bits a channel, by libjpeg-turbo.

simplejpeg decodes: it is the fastest of the packages, and reports damage. Pillow encodes: of the packages that release
Python's lock only it accepts quantization tables. Both hold a pixel as red, green, blue and an unused fourth byte, the
layout that OpenColorIO packs fastest.
"""

from collections.abc import Mapping
from io import FileIO
from pathlib import Path

import simplejpeg
from PIL import Image as Pillow

from lutforge.arrays import Codes
from lutforge.errors import ImageError
from lutforge.images.jpeg import EOI, SOI, JpegHeader

_SUBSAMPLING: Mapping[tuple[tuple[int, int], ...], int] = {
    (of_luma, (1, 1), (1, 1)): number for number, of_luma in enumerate(((1, 1), (2, 1), (2, 2)))
}
"""Sampling factors of Y, Cb and Cr, and Pillow's numbers for them."""


def decode(path: Path, data: bytes, canvas: Codes) -> None:
    """Decode a JPEG into `canvas` (h, w, 3 or 4). Raises ImageError where it is damaged."""
    try:
        simplejpeg.decode_jpeg(data, "RGB" if canvas.shape[2] == 3 else "RGBX", buffer=canvas)
    except ValueError as error:
        raise ImageError(f"{path}: damaged or cut short ({error}); copy the file again") from error


def encode(file: FileIO, canvas: Codes, start: bytes, source: JpegHeader) -> None:
    """Write pixels (h, w, 4) as a JPEG with the quantization tables and chroma subsampling of another, the source.

    start: SOI and the metadata segments, of at least 20 bytes.
    """
    tables = source.tables[:2] if source.tables[1] == source.tables[2] else source.tables
    picture = Pillow.frombuffer("RGBX", (canvas.shape[1], canvas.shape[0]), canvas, "raw", "RGBX", 0, 1)
    # Pillow begins with 20 bytes, SOI and a JFIF segment, which the source's segments replace.
    file.seek(len(start) - 20)
    picture.save(
        file, "JPEG", quality=-1, subsampling=_SUBSAMPLING.get(source.sampling, 0),
        qtables=[list(steps) for steps in tables],
    )  # fmt: skip
    file.seek(-2, 2)
    if file.read(2) != EOI:
        raise OSError(None, "it was not written as a whole; is the disk full?")
    file.seek(len(start) - 20)
    if file.read(20)[:6] != SOI + b"\xff\xe0\0\x10":
        raise OSError(None, "Pillow began the file in another way than with 20 bytes of JFIF")
    file.seek(0)
    file.write(start)
