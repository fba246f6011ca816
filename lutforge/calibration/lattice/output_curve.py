"""The output curve behind a cube, with which a small cube can hold a rendering that clips.

Encoded values have a kink where a camera clips. It lies on oblique planes, which a lattice along the axes cannot
follow. Encoded values also have their largest curvature in dark colours. So the cube holds values v that continue
smoothly across the clipping, and the curve I(v) behind it has the curvature and clamps. Its slope is dI/dv ∝ 1 + f',
half way between encoded values (dI/dv = 1) and linear light (dI/dv = f').
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import apply_curve
from lutforge.model.response import Response


@dataclass(frozen=True, eq=False)
class OutputCurve:
    """An output curve for each channel.

    table: (4096, 3), I at even steps of v in [0, 1], rising from 0 to 1; linear, values: (n, 3), f⁻¹ and v at n even
    steps of I; ends: (2, 3), dv/d(linear) below and above them.
    """

    table: Array
    linear: Array
    values: Array
    ends: Array

    def to_values(self, encoded: Array) -> Array:
        """Take I (…, 3) in [0, 1] to the values v in front of the curve, by its table as files hold it."""
        points = np.ascontiguousarray(encoded, dtype=np.float64)
        return np.asarray(_enter(self.table, self.values, points.reshape(-1, 3))).reshape(points.shape)

    def to_encoded(self, values: Array) -> Array:
        """Take values v (…, 3) in front of the curve to I in [0, 1]."""
        return apply_curve(self.table, values)

    def slope(self, encoded: Array) -> Array:
        """dI/dv at I (…, 3), over two codes."""
        low, high = np.clip(encoded - 1 / 255, 0.0, 1.0), np.clip(encoded + 1 / 255, 0.0, 1.0)
        return np.asarray((high - low) / (self.to_values(high) - self.to_values(low)))

    def continued(self, linear: Array) -> Array:
        """Take linear light (…, 3) to v, which continues as a straight line where the camera clips."""
        points = np.ascontiguousarray(linear, dtype=np.float64)
        found = _continued(*self._by_linear, self.values, self.ends, points.reshape(-1, 3))
        return np.asarray(found).reshape(points.shape)

    @cached_property
    def _by_linear(self) -> tuple[Array, Index]:
        """f⁻¹ (3, n), and which of its cells even steps of linear light from its start to its end lie in."""
        axes = np.ascontiguousarray(self.linear.T)
        cells = [np.searchsorted(axis[1:-1], np.linspace(axis[0], axis[-1], 1024), side="right") for axis in axes]
        return axes, np.array(cells)


@compiled()
def _enter(table: Array, values: Array, encoded: Array) -> Array:
    """Return v (n, 3) of I in [0, 1] by inverting the table; `values` gives the cell to begin at."""
    last = len(table) - 1
    entered = np.empty_like(encoded)
    for n in range(len(encoded)):
        for c in range(3):
            value = min(max(encoded[n, c], 0.0), 1.0)
            at = min(int(value * last), last - 1)
            near = values[at, c] + (value * last - at) * (values[at + 1, c] - values[at, c])
            cell = min(max(int(near * last), 0), last - 1)
            while cell > 0 and value < table[cell, c]:
                cell -= 1
            while cell < last - 1 and value >= table[cell + 1, c]:
                cell += 1
            width = table[cell + 1, c] - table[cell, c]
            entered[n, c] = (cell + (min((value - table[cell, c]) / width, 1.0) if width > 0.0 else 0.0)) / last
    return entered


@compiled()
def _continued(known: Array, cells: Index, values: Array, ends: Array, linear: Array) -> Array:
    """v (n, 3) of linear light; known: (3, m), f⁻¹ at the even steps of I that values (m, 3) are at; cells: (3, k)."""
    result, last = np.empty_like(linear), cells.shape[1] - 1
    for c in range(3):
        axis = known[c]
        first, span = axis[0], axis[-1] - axis[0]
        for n in range(len(linear)):
            at = linear[n, c]
            below, above = min(at - first, 0.0), max(at - axis[-1], 0.0)
            inside = at - below - above
            step = (inside - first) / span * last
            cell = cells[c, int(step)] if step > 0.0 else 0  # NaN, too
            while cell < len(axis) - 2 and inside >= axis[cell + 1]:
                cell += 1
            width = axis[cell + 1] - axis[cell]
            part = (inside - axis[cell]) / width if width > 0.0 else 1.0
            value = values[cell, c] + part * (values[cell + 1, c] - values[cell, c])
            result[n, c] = value + below * ends[0, c] + above * ends[1, c]
    return result


def output_curve(response: Response) -> OutputCurve:
    """The curve of a camera with response f.

    f' is bounded by 8, with respect to the whole range of linear light. A fitted f can be arbitrarily steep at the very
    foot, where saturated colours stay away from black: errors of the cube must not be multiplied by that.
    """
    entries = 4096
    codes = np.linspace(0.0, 1.0, entries)
    inverse = response.inverse
    linear = PchipInterpolator(np.linspace(0.0, 1.0, len(inverse)), inverse, axis=0)(codes)
    span = linear[-1] - linear[0]
    slope = np.maximum(np.gradient(linear / span, 1.0 / (entries - 1), axis=0), 1.0 / 8.0)  # of f⁻¹
    rate = slope / (1.0 + slope)
    values = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (rate[1:] + rate[:-1]), axis=0) / (entries - 1)])
    total = values[-1].copy()
    values /= total
    table = np.stack([np.interp(codes, values[:, c], codes) for c in range(3)], axis=1)
    ends = (rate / slope)[[0, -1]] / (total * span)
    return OutputCurve(table, linear, values, ends)
