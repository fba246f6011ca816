"""HaldCLUT: a uniform cube of L² nodes per axis as an image of L³ × L³ pixels, red fastest (Eskil Steenberg's Hald).

For RawTherapee, darktable, G'MIC and ImageMagick; 16 bits per channel, PNG or TIFF. What reads and writes images is
loaded where there is one: every LUT loads this file.
"""

from math import isqrt
from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import cube_of_rows, plain, rows_of_cube
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import FileFormat, Lut

SIZES = tuple(level * level for level in range(2, 12))
"""Nodes per axis that a Hald image can have."""


def write(lut: Lut, path: Path) -> None:
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


def read(path: Path) -> Lut:
    """Read it through OpenImageIO, after its size is known to be a Hald's. Raises LutError."""
    import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
    from PIL.PngImagePlugin import PngImageFile

    from lutforge.images.read import ImageReader

    with path.open("rb") as file:
        head = file.read(4)
    if head not in (b"\x89PNG", b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+"):
        raise LutError(f"{path}: neither a PNG nor a TIFF image")
    if head == b"\x89PNG":
        with PngImageFile(path) as picture:
            picture.verify()  # libpng would say on the terminal what is damaged
    with ImageReader(path) as reader:
        spec = reader.spec
        level = next((level for level in range(2, 13) if level**3 == spec.width), None)
        if level is None or spec.height != spec.width:
            raise LutError(
                f"{path}: {spec.width} × {spec.height} pixels; a Hald image is square, of 8, 27, 64, 125, 216, 343, "
                "512 … pixels a side"
            )
        if not 3 <= spec.nchannels <= 4:
            raise LutError(f"{path}: {spec.nchannels} channels; a Hald image has three")
        table = reader.read(reader.whole).astype(np.float64).reshape(spec.width**2, -1)[:, :3]
    bits = {oiio.UINT8: 8, oiio.UINT16: 16}.get(spec.format.basetype)
    title, *comments = str(spec.get_string_attribute("ImageDescription"))[:1000].split("; ")
    cube = Cube(cube_of_rows(table, level * level), "trilinear")
    return Lut((cube,), title[:200], tuple(comments), {"format": "Hald image", **({"bits": str(bits)} if bits else {})})


HALD = FileFormat("a Hald image", (".png", ".tif", ".tiff"), ("plain",), write, SIZES, 64, 16, read=read)
