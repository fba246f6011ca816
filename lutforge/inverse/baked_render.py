"""A baked render in its parts: node levels, cube and output curve, evaluated as the LUT file is."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Levels, apply_curve, interpolate
from lutforge.luts.axes import node_levels
from lutforge.luts.ops import Cube, Curve, Range
from lutforge.luts.sequence import Lut


@dataclass(frozen=True, eq=False)
class BakedRender:
    """RAW (…, 3) → lattice → output curve → JPEG, as the file of a render evaluates it.

    levels: three axes of N node levels in RAW; values: (N, N, N, 3), in front of the output curve; tetrahedral: how
    these are interpolated, else trilinearly; output_curve: (m, 3), non-decreasing, at m even steps of [0, 1], clamped.
    """

    levels: Levels
    values: Array
    tetrahedral: bool
    output_curve: Array

    @classmethod
    def of(cls, lut: Lut) -> "BakedRender":
        """The parts of a render LUT: node levels, a cube, an output curve. Raises LutError on any other sequence."""
        ops = [op for op in lut.ops if not isinstance(op, Range)]
        if isinstance(ops[-1], Cube):
            ops.append(Curve(np.repeat([[0.0], [1.0]], 3, axis=1)))
        match ops:
            case [Cube() as cube, Curve() as output_curve]:
                levels = node_levels(None, cube)
            case [Curve() as front, Cube() as cube, Curve() as output_curve] if _only_spreads(front, cube):
                levels = node_levels(front, cube)
            case _:
                raise LutError(f"a render is node levels, a cube and a curve, not {lut.summary}")
        return cls(levels, cube.values, cube.interpolation == "tetrahedral", output_curve.outputs)

    def __call__(self, raw: Array) -> Array:
        """JPEG colours of RAW (…, 3), clamped to [0, 1] as a file holds them."""
        return np.clip(apply_curve(self.output_curve, self.cube_values(raw)), 0.0, 1.0)

    def cube_values(self, raw: Array) -> Array:
        """Lattice values of RAW (…, 3), in front of the output curve."""
        return interpolate(raw, self.levels, self.values, "tetrahedral" if self.tetrahedral else "trilinear")

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

    @cached_property
    def mean_slope(self) -> Array:
        """Mean slope of the lattice over the diagonal of its range, (3, 3): the matrix of the rendering."""
        grey = np.linspace(0.05, 0.95, 19)[:, None].repeat(3, axis=1)
        steps = 0.02 * np.eye(3)
        rise = [(self.cube_values(grey + step) - self.cube_values(grey - step)) / 0.04 for step in steps]
        lattice_values = self.cube_values(grey)
        inside = np.all((lattice_values > 0.0) & (lattice_values < 1.0), axis=1)
        return np.asarray(np.stack(rise, axis=-1)[inside if inside.any() else slice(None)].mean(axis=0))


def _only_spreads(front: Curve, cube: Cube) -> bool:
    """True where a curve takes node levels to even steps and runs straight between them, to a sixtieth of a cell."""
    at, levels = np.linspace(front.low, front.high, len(front.outputs)), node_levels(front, cube)
    straight = [np.interp(at, axis, np.linspace(0.0, 1.0, len(axis))) for axis in levels]
    return front.inputs is None and np.abs(np.stack(straight, axis=1) - front.outputs).max() * cube.size < 1 / 60
