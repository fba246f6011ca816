"""A baked render as its parts: a matrix, node levels, a cube and an output curve, in the order of its file."""

from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import apply_curve
from lutforge.luts.ops import Cube, Curve, Matrix, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import node_levels
from lutforge.model.lattice import Lattice


class BakedRender(Lattice):
    """RAW (…, 3) → matrix → lattice → output curve → JPEG, as the file of a render evaluates it."""

    output_curve: Array

    @classmethod
    def of(cls, lut: Lut) -> "BakedRender":
        """The parts of a render LUT: matrix, node levels, cube, output curve. Raises LutError on any other sequence."""
        ops = [op for op in lut.ops if not isinstance(op, Range)]
        matrix = None
        if isinstance(ops[0], Matrix):
            matrix = np.column_stack([ops[0].matrix, ops[0].offset])
            ops = ops[1:]
        if isinstance(ops[-1], Cube):
            ops.append(Curve(np.repeat([[0.0], [1.0]], 3, axis=1)))
        match ops:
            case [Cube() as cube, Curve() as output_curve]:
                levels = node_levels(None, cube)
            case [Curve() as front, Cube() as cube, Curve() as output_curve] if _only_spreads(front, cube):
                levels = node_levels(front, cube)
            case _:
                raise LutError(f"a render is node levels, a cube and a curve, not {lut.summary}")
        return cls(levels, cube.values, cube.interpolation, output_curve.outputs, matrix)

    def __call__(self, raw: ArrayLike) -> Array:
        """JPEG colours of RAW (…, 3), clamped to [0, 1] as a file holds them."""
        return np.clip(super().__call__(raw), 0.0, 1.0)

    def to_values(self, jpeg: Array) -> Array:
        """Return the lattice values in [0, 1] that the output curve takes to JPEG colours (…, 3)."""
        return apply_curve(self.curve, jpeg)

    def slope(self, lattice_values: Array) -> Array:
        """Return the slope of the output curve at lattice values (…, 3), at least 0.05, so that every error counts."""
        return np.maximum(apply_curve(self._slopes, lattice_values), 0.05)

    @cached_property
    def curve(self) -> Array:
        """The inverse of the output curve at 4096 even steps of the JPEG value, (4096, 3)."""
        even, at = np.linspace(0.0, 1.0, 4096), np.linspace(0.0, 1.0, len(self.output_curve))
        columns = []
        for table in self.output_curve.T:
            rising = np.concatenate([[True], np.diff(table) > 1e-9])
            columns.append(np.interp(even, table[rising], at[rising]))
        return np.stack(columns, axis=1)

    @cached_property
    def _slopes(self) -> Array:
        """Slopes of the output curve over the width of half a code, at even steps."""
        x = np.linspace(0.0, 1.0, 1024)[:, None].repeat(3, axis=1)
        low, high = np.clip(x - 1e-3, 0.0, 1.0), np.clip(x + 1e-3, 0.0, 1.0)
        return np.asarray((apply_curve(self.output_curve, high) - apply_curve(self.output_curve, low)) / (high - low))


def _only_spreads(front: Curve, cube: Cube) -> bool:
    """True where a curve maps node levels to even steps, and is straight between them, within a sixtieth of a cell."""
    at, levels = np.linspace(front.low, front.high, len(front.outputs)), node_levels(front, cube)
    straight = [np.interp(at, axis, np.linspace(0.0, 1.0, len(axis))) for axis in levels]
    return front.inputs is None and np.abs(np.stack(straight, axis=1) - front.outputs).max() * cube.size < 1 / 60
