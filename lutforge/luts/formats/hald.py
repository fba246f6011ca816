"""HaldCLUT: a uniform cube of L² nodes per axis as an image of L³ × L³ pixels, red fastest (Eskil Steenberg's Hald).

For RawTherapee, darktable, G'MIC and ImageMagick; 16 bits per channel, PNG or TIFF.
"""

from math import isqrt
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import LutError
from lutforge.luts.formats.text import plain
from lutforge.luts.lut import Lut

SIZES = tuple(level * level for level in range(2, 12))
"""Nodes per axis that a Hald image can have."""


def write(lut: Lut, path: Path) -> None:
    """Write a uniform LUT, outputs clamped to [0, 1]. Raises LutError where the size is no square."""
    if not lut.is_uniform or lut.has_gain or lut.has_matrix or lut.response is not None or lut.size not in SIZES:
        raise LutError(f"{path}: a Hald image holds a uniform cube of 4, 9, 16, 25, 36, 49, 64 … nodes per axis")
    side = isqrt(lut.size) ** 3
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(side, side, 3)
    codes = np.rint(np.clip(table, 0.0, 1.0) * 65535).astype(np.uint16)
    spec = oiio.ImageSpec(side, side, 3, oiio.UINT16)
    spec["ImageDescription"] = "; ".join(plain(text) for text in (lut.title, *lut.comments) if plain(text))
    output = oiio.ImageOutput.create(str(path))
    if output is None:
        raise LutError(f"{path}: OpenImageIO cannot write this kind of image: {oiio.geterror()}")
    try:
        if not output.open(str(path), spec) or not output.write_image(codes):
            raise LutError(f"{path}: cannot be written: {output.geterror()}")
    finally:
        output.close()
