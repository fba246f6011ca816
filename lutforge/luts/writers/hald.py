"""Hald images (Eskil Steenberg): cubes of L² even nodes per axis as pictures of L³ × L³ pixels, red fastest."""

from math import isqrt
from pathlib import Path

import numpy as np

from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.writers.text import plain, rows_of_cube

HALD_SIZES = tuple(level * level for level in range(2, 12))
"""Nodes per axis that a Hald image can have."""


def write_hald(lut: OpSequence, path: Path) -> None:
    """Write a cube in 16 bits, outputs clamped to [0, 1]. Raises LutError, and ImageError where the disk is full."""
    import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

    from lutforge.images.read import Region
    from lutforge.images.write import image_writer

    _, cube = lut.shaper_and_cube()
    side = isqrt(lut.size) ** 3
    codes = np.rint(np.clip(rows_of_cube(cube.values), 0.0, 1.0) * 65535).astype(np.uint16).reshape(side, side, 3)
    spec = oiio.ImageSpec(side, side, 3, oiio.UINT16)
    spec["ImageDescription"] = "; ".join(plain(text) for text in (lut.title, *lut.comments) if plain(text))
    with image_writer(path, spec) as output:
        output.write(Region(0, 0, side, side), codes)
