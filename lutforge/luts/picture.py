"""LUTs that are pictures: Hald images, lookups in square tiles, and strips of game engines.

Their content shows which of these they are. A cube of m² nodes per axis is a square of m³ × m³ pixels both as a Hald
(Eskil Steenberg's), which fills whole rows of the picture, and as m × m tiles of one blue level each, the layout of
GPUImage. Read as the wrong one of the two, neighbouring colours jump.
"""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.boundary import reading
from lutforge.errors import LutError, LutForgeError
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut

SUFFIXES = (".png", ".tif", ".tiff")
HALD_LEVELS = range(2, 17)
"""Levels of the Hald images that are read: at 16 each 8-bit colour has a node."""
LARGEST_STRIP = 129
"""Most nodes per axis of a strip."""
MOST_CHANGE = 1.5
"""Largest mean variation of a channel along an axis, in units of the range of all values.

Looks have 0.3 to 1.2, photographs 0.8 to 8.
"""
LEAST_LINEAR_SHARE = 0.6
"""Least share of the variance that red, green and blue explain linearly.

Looks have 0.66 to 1, black-and-white ones among them, photographs less than 0.57.
"""
LEAST_AXIS = 0.005
"""Least share of the variance that the channel with the least influence explains.

Looks have 0.009 to 0.33, photographs less than 0.005.
"""
HALD = "Hald image"


def read_picture(path: Path) -> Lut:
    """Read a PNG or TIFF that holds a LUT. Raises LutError where its size or its content is that of none."""
    import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
    from PIL.PngImagePlugin import PngImageFile

    from lutforge.images.read import ImageReader

    with path.open("rb") as file:
        head = file.read(4)
    if head not in (b"\x89PNG", b"II*\x00", b"MM\x00*", b"II+\x00", b"MM\x00+"):
        raise LutError(f"{path}: neither a PNG nor a TIFF image")
    if head == b"\x89PNG":
        with PngImageFile(path) as picture:
            picture.verify()  # before libpng reads it, which would print on the terminal what is damaged
    with ImageReader(path) as reader:
        spec = reader.spec
        if not has_size_of_lut(spec.width, spec.height):
            raise LutError(
                f"{path}: {spec.width} × {spec.height} pixels; a Hald image or a lookup in tiles is square, of 8, 27, "
                "64, 125, 216, 343, 512 … pixels a side, and a strip has as many tiles as each has pixels a side, as "
                "1024 × 32"
            )
        if not 3 <= spec.nchannels <= 4:
            raise LutError(f"{path}: {spec.nchannels} channels; a Hald image has three")
        pixels = reader.read(reader.whole)[..., :3].astype(np.float64)
    layouts = {name: (_change(values), values) for name, values in _layouts(pixels)}
    name, (change, values) = min(layouts.items(), key=lambda item: item[1][0])
    if change > MOST_CHANGE and sum(_linear_shares(values)) < LEAST_LINEAR_SHARE:
        raise LutError(
            f"{path}: has the size of a LUT, but its neighbouring colours jump as in no {' or '.join(layouts)}: a "
            "picture? A LUT that was scaled, or compressed as a JPEG, is none any more"
        )
    bits = {oiio.UINT8: 8, oiio.UINT16: 16}.get(spec.format.basetype)
    title, *comments = str(spec.get_string_attribute("ImageDescription"))[:1000].split("; ")
    cube = Cube(np.ascontiguousarray(values, dtype=np.float64), "trilinear")
    return Lut((cube,), title[:200], tuple(comments), LutMetadata(format=name, bits=bits))


def has_size_of_lut(width: int, height: int) -> bool:
    """True of a picture that may be a Hald, a lookup in tiles or a strip."""
    short, long = min(width, height), max(width, height)
    return (long == short**2 <= LARGEST_STRIP**2 and short > 1) or width == height in {
        level**3 for level in HALD_LEVELS
    }


def is_picture_of_lut(path: Path) -> bool:
    """True of a file whose size and content are those of a LUT; any other, damaged ones too, is a picture."""
    try:
        with reading(path, "a LUT"):
            cube = read_picture(path).cube
    except LutForgeError:
        return False
    shares = (0.0,) if cube is None else _linear_shares(cube.values)
    return sum(shares) >= LEAST_LINEAR_SHARE and min(shares) >= LEAST_AXIS


def _layouts(pixels: Array) -> Iterator[tuple[str, Array]]:
    """The layouts in which a picture (h, w, 3) can hold a cube: their names, and node values (N_r, N_g, N_b, 3)."""
    height, width = pixels.shape[:2]
    if height == width:
        m = round(height ** (1 / 3))
        n = m * m
        yield HALD, pixels.reshape(n, n, n, 3).transpose(2, 1, 0, 3)
        tiles = pixels.reshape(m, n, m, n, 3)  # row of tiles, green, column of tiles, red
        yield f"lookup of {m} × {m} tiles", tiles.transpose(3, 1, 0, 2, 4).reshape(n, n, n, 3)
        return
    n = min(height, width)
    if width > height:
        values, name = pixels.reshape(n, n, n, 3).transpose(2, 0, 1, 3), f"strip of {n} tiles"
    else:
        values, name = pixels.reshape(n, n, n, 3).transpose(2, 1, 0, 3), f"column of {n} tiles"
    rises = [
        float(np.mean(np.take(values, -1, axis)[..., axis] - np.take(values, 0, axis)[..., axis])) for axis in range(3)
    ]
    if rises[1] < 0 < min(rises[0], rises[2]):  # in OpenGL the first row of a picture is the lowest
        values, name = values[:, ::-1], f"{name}, green upwards"
    yield name, values


def _change(values: Array) -> float:
    """The mean total variation of a channel along an axis, in units of the range of all values; 0 of one colour."""
    span = float(np.ptp(values))
    variations = [float(np.mean(np.abs(np.diff(values, axis=axis)))) * (values.shape[axis] - 1) for axis in range(3)]
    return sum(variations) / 3 / span if span > 0 else 0.0


def _linear_shares(values: Array) -> tuple[float, ...]:
    """The share of a cube's variance that each of the three inputs explains linearly; 0 of one colour."""
    total = float(values.var(axis=(0, 1, 2)).sum())
    shares = []
    for axis in range(3):
        other_axes = tuple(index for index in range(3) if index != axis)
        means = values.mean(axis=other_axes)
        levels = np.linspace(-1.0, 1.0, values.shape[axis])
        slopes = levels @ means / (levels @ levels)
        shares.append(float(slopes @ slopes) * float(np.mean(levels**2)) / total if total > 0 else 0.0)
    return tuple(shares)
