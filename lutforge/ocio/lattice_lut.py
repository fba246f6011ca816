"""A LUT of a config as its node levels and values: what a fit of two directions to each other moves."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, Levels, interpolate, through
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import SHAPER_SIZE, is_even, node_levels, shaper
from lutforge.model.transform import checked_colours

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LatticeLut:
    """y = matrix · response(cube(curve(clamp(i)))), i = (x − lowest) / (1 − lowest).

    levels: (N,) per axis, of i, on the grid of a shaper of `shaper_size` entries; cube: (N, N, N, 3); curve: (m, 3),
    rising, or none: the cube is linear in its values between nodes; response: (m, 3), or none.
    """

    levels: Levels
    cube: Array
    shaper_size: int = SHAPER_SIZE
    interpolation: Interpolation = "tetrahedral"
    title: str = ""
    comments: tuple[str, ...] = ()
    curve: Array | None = None
    response: Array | None = None
    lowest: float = 0.0
    matrix: Array = field(default_factory=lambda: np.eye(3))

    def __call__(self, x: ArrayLike) -> Array:
        """Colours (…, 3) → (…, 3)."""
        y = self.inner(x)
        if self.response is not None:
            y = through(self.response, y)
        return np.asarray(y @ self.matrix.T)

    def inner(self, x: ArrayLike) -> Array:
        """The same in front of response and matrix."""
        inside = np.clip((np.nan_to_num(checked_colours(x)) - self.lowest) / (1 - self.lowest), 0.0, 1.0)
        stretched = inside if self.curve is None else through(self.curve, inside)
        return interpolate(stretched, self.knots, self.cube, self.interpolation)

    @property
    def knots(self) -> Levels:
        """The node levels behind the curve: where the cube is interpolated."""
        if self.curve is None:
            return self.levels
        r, g, b = through(self.curve, np.stack(self.levels, axis=1)).T
        return np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b)

    @property
    def size(self) -> int:
        """Nodes per axis."""
        return len(self.levels[0])

    @property
    def is_uniform(self) -> bool:
        """True where the file needs no shaper."""
        return self.curve is None and self.lowest == 0 and is_even(self.levels)

    def as_lut(self) -> Lut:
        """The sequence of operations that the file holds."""
        span = 1 - self.lowest
        ahead, behind = Matrix(np.eye(3) / span, np.full(3, -self.lowest / span)), Matrix(self.matrix)
        ops: tuple[Op, ...] = (
            *(() if ahead.is_identity else (ahead,)),
            Range(),
            *(() if self.is_uniform else (shaper(self.levels, self.shaper_size, self.curve),)),
            Cube(self.cube, self.interpolation),
            *(() if self.response is None else (Curve(self.response),)),
            *(() if behind.is_identity else (behind,)),
        )
        return Lut(ops, self.title, self.comments)


def lattice_lut(lut: Lut) -> LatticeLut:
    """A baked LUT without gain as its node levels and values. Raises LutError on any other sequence."""
    ops = [op for op in lut.ops if not isinstance(op, Range)]
    front = ops.pop(0) if isinstance(ops[0], Curve) else None
    cube = ops.pop(0)
    response = ops.pop(0) if ops and isinstance(ops[0], Curve) else None
    matrix = ops.pop(0) if ops and isinstance(ops[0], Matrix) else Matrix(np.eye(3))
    if not isinstance(cube, Cube) or not isinstance(front, Curve | None) or ops or not isinstance(matrix, Matrix):
        raise LutError(f"LUT: a cube between curves is wanted, not {lut.summary}")
    levels = node_levels(front, cube)
    found = LatticeLut(
        levels, cube.values, SHAPER_SIZE if front is None else len(front.outputs), cube.interpolation, lut.title,
        lut.comments, None, response.outputs if isinstance(response, Curve) else None, 0.0, matrix.matrix,
    )  # fmt: skip
    if front is None or np.abs(shaper(levels, len(front.outputs)).outputs - front.outputs).max() < 1e-9:
        return found
    return replace(found, curve=front.outputs)
