"""LUTs of node levels and values, for tests."""

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels
from lutforge.luts.bake import joined
from lutforge.luts.ops import Cube, Matrix, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import SHAPER_SIZE, is_even, shaper

Array = NDArray[np.float64]


def lut_of_nodes(
    levels: Levels,
    values: Array,
    gain: tuple[float, float, float] = (1.0, 1.0, 1.0),
    matrix: Array | None = None,
    size: int = SHAPER_SIZE,
    interpolation: Interpolation = "tetrahedral",
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Lut:
    """Gain → clamp → shaper → cube → matrix, without what changes nothing."""
    curve = () if is_even(levels) else (shaper(levels, size),)
    behind = Matrix(np.eye(3) if matrix is None else matrix)
    return Lut(joined((Matrix(np.diag(gain)), Range(), *curve, Cube(values, interpolation), behind)), title, comments)
