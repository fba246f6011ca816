"""Small LUTs and images."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.grading.pixels import grade_floats
from lutforge.interpolation import Interpolation, Levels
from lutforge.luts.ops import Cube, Matrix, Range, joined
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import MAX_SHAPER_SIZE, is_even, shaper

Pixels = NDArray[np.float32]


def write_cube(path: Path, gamma: float = 0.8, nodes: int = 9) -> Path:
    """A .cube: a power with the channels mixed a little."""
    axis = np.linspace(0, 1, nodes)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    table = np.stack([red, green, blue], -1).reshape(-1, 3) ** gamma @ [[0.9, 0.1, 0], [0, 0.8, 0.2], [0.1, 0.1, 0.8]]
    rows = "\n".join(" ".join(f"{value:.6f}" for value in row) for row in table)
    path.write_text(f"LUT_3D_SIZE {nodes}\n{rows}\n")
    return path


def write_picture(
    path: Path,
    size: tuple[int, int] = (40, 64),
    kind: str = "uint8",
    tile: int = 0,
    channels: int = 3,
    seed: int = 0,
    pixels: Pixels | None = None,
    names: tuple[str, ...] = (),
    **attributes: object,
) -> Pixels:
    """A noisy picture, or one of these pixels. names: of the channels; attributes: metadata, with _ for : in names."""
    if pixels is None:
        pixels = np.random.default_rng(seed).random((*size, len(names) or channels), dtype=np.float32)
    spec = oiio.ImageSpec(pixels.shape[1], pixels.shape[0], pixels.shape[2], kind)
    if names:
        spec.channelnames = names
    spec.tile_width = spec.tile_height = tile
    for name, value in attributes.items():
        spec[name.replace("_", ":")] = value
    target = oiio.ImageOutput.create(str(path))
    assert target is not None
    assert target.open(str(path), spec), target.geterror()
    assert target.write_image(pixels), target.geterror()
    assert target.close(), target.geterror()
    return pixels


def lut_of_nodes(
    levels: Levels,
    values: Array,
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0),
    matrix: Array | None = None,
    size: int = MAX_SHAPER_SIZE,
    interpolation: Interpolation = "tetrahedral",
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Lut:
    """Gain → clamp → shaper → cube → matrix, without what changes nothing."""
    curve = () if is_even(levels) else (shaper(levels, size),)
    behind = Matrix(np.eye(3) if matrix is None else matrix)
    return Lut(joined((Matrix(np.diag(gain)), Range(), *curve, Cube(values, interpolation), behind)), title, comments)


def apply_to_pixels(
    processor: OCIO.CPUProcessor, pixels: Pixels, premultiplied: bool = False, workers: int = 2
) -> Pixels:
    """Pixels (h, w, c ≥ 3) graded as `apply` grades those of a picture, on so many threads."""
    result = np.array(pixels, dtype=np.float32, order="C")
    with ThreadPoolExecutor(workers) as threads:
        grade_floats(processor, result, premultiplied, threads)
    return result
