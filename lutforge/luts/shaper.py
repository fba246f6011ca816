"""The shaper: the curve before a cube, which spreads node levels that lie where a function bends (thesis, chapter 5).

s_c(L_c(i)) = i / (N − 1), linear in between. Sampled at M even points it stays exact where the node levels are among
the points: readers interpolate linearly between samples.
"""

from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Levels
from lutforge.luts.ops import Cube, Curve, Matrix, Op, Range
from lutforge.model.lattice import SHORT_SHAPER_SIZE, Lattice, grid

MAX_SHAPER_SIZE = 65536
"""Entries of a shaper: the most that DaVinci Resolve and OpenColorIO read in a .cube file."""


def shaper(levels: Levels, size: int = MAX_SHAPER_SIZE, axis_curve: Array | None = None, high: float = 1.0) -> Curve:
    """The curve that takes node levels, multiples of 1 / (size − 1), to even steps.

    levels: (N,) per channel, as shares of the domain from 0 to `high`; they may end before or beyond it.
    axis_curve: (m, 3), rising, at even steps of the domain: the cube is linear in its values between two nodes, and not
    in the inputs. Raises LutError where a level is not on the grid, or the curve does not rise from node to node.
    """
    if not 2 <= size <= MAX_SHAPER_SIZE:
        raise LutError(f"LUT: a shaper of {size} entries; readers take 2 to {MAX_SHAPER_SIZE}")
    for name, axis in zip("RGB", levels, strict=True):
        if not np.all(np.isfinite(axis)) or axis[0] != 0 or not np.all(np.diff(axis) > 0):
            raise LutError(f"LUT: the {name} node levels do not increase strictly from 0")
        if not on_grid(axis, size):
            raise LutError(
                f"LUT: node levels are not multiples of 1/{size - 1}, so a shaper of {size} entries cannot hold them; "
                "snap them before the fit"
            )
    return Curve(_spread(levels, np.linspace(0.0, 1.0, size), axis_curve), 0.0, high)


def shaper_error(levels: Levels, size: int, axis_curve: Array | None) -> float:
    """The largest error of a shaper of `size` entries, half way between them; arguments and errors as in `shaper`."""
    half_way = (np.arange(size - 1) + 0.5) / (size - 1)
    exact = _spread(levels, half_way, axis_curve)
    return float(np.abs(shaper(levels, size, axis_curve)(half_way[:, None].repeat(3, axis=1)) - exact).max())


def _spread(levels: Levels, at: Array, axis_curve: Array | None) -> Array:
    """The mapping (n, 3) of node levels to even steps, per channel, at shares of the domain (n,)."""
    columns = []
    for c, axis in enumerate(levels):
        x = at
        knots = axis
        if axis_curve is not None:
            even = np.linspace(0.0, 1.0, len(axis_curve))
            x = np.interp(at, even, axis_curve[:, c])
            # Beyond the domain the curve continues as a straight line: a last level there differs from the others.
            knots = np.interp(axis, even, axis_curve[:, c]) + np.maximum(axis - 1.0, 0.0)
            if not np.all(np.diff(knots) > 0):
                raise LutError("LUT: the axis curve does not rise from one node level to the next")
        columns.append(np.interp(x, knots, np.linspace(0.0, 1.0, len(axis))))
    return np.stack(columns, axis=1)


def node_levels(curve: Curve | None, cube: Cube) -> Levels:
    """The inputs (N,) of a shaper, or of none, at which its cube's nodes lie, per channel.

    Nodes that the shaper does not reach are placed at the end of its domain.
    """
    r, g, b = (np.linspace(0.0, 1.0, count) for count in cube.values.shape[:3])
    if curve is None:
        return r, g, b
    even_inputs = np.linspace(curve.low, curve.high, len(curve.outputs))
    levels = []
    for c, even in enumerate((r, g, b)):
        rising = np.maximum.accumulate(curve.outputs[:, c])
        first = np.concatenate([[True], np.diff(rising) > 0])  # a level of a flat piece is reached where it begins
        inputs = even_inputs if curve.inputs is None else curve.inputs[:, c]
        levels.append(np.interp(even, rising[first], inputs[first]))
    return levels[0], levels[1], levels[2]


def on_grid(axis: Array, size: int) -> bool:
    """True where every node level is one of the points of a sampled shaper of `size` entries."""
    points = axis * (size - 1)
    return bool(np.all(np.abs(points - np.rint(points)) < 1e-6))


def is_even(levels: Levels) -> bool:
    """True where node levels are evenly spaced on [0, 1], so that no shaper is needed."""
    return all(np.allclose(axis, np.linspace(0.0, 1.0, len(axis)), rtol=0, atol=1e-12) for axis in levels)


def levels_before_gain(levels: Levels, gain: Array) -> Levels:
    """Node levels (N,) before a gain (3,), of those after it: L / gain, moved to the points of a shaper.

    No two levels of an axis move to the same point. The last one may be below or above 1; it is rounded up, so that
    inputs which the camera clips are still clipped.
    """
    moved = []
    for axis, factor in zip(levels, gain, strict=True):
        scaled = axis / factor * (MAX_SHAPER_SIZE - 1)
        points = np.rint(scaled).astype(np.int64)
        points[-1] = int(np.ceil(scaled[-1] - 1e-6))
        order = np.arange(len(axis))
        moved.append((np.maximum.accumulate(points - order) + order) / (MAX_SHAPER_SIZE - 1))
    return moved[0], moved[1], moved[2]


def lattice_ops(lattice: Lattice) -> tuple[Op, ...]:
    """A lattice as matrix, shaper, cube and output curve; exact where its levels are on a grid and equal in number.

    Otherwise levels are added in the widest cells, or moved to the grid, and the cube is evaluated there.
    """
    size = max(lattice.size)
    padded = []
    for axis in lattice.levels:
        while len(axis) < size:
            widest = int(np.argmax(np.diff(axis)))
            axis = np.insert(axis, widest + 1, 0.5 * (axis[widest] + axis[widest + 1]))
        padded.append(axis)
    r, g, b = padded

    sizes = (SHORT_SHAPER_SIZE, MAX_SHAPER_SIZE)
    entries = next((count for count in sizes if all(on_grid(axis, count) for axis in (r, g, b))), None)
    if entries is None and not is_even((r, g, b)):
        r, g, b = levels_before_gain((r, g, b), np.ones(3))
    unchanged = all(np.array_equal(new, old) for new, old in zip((r, g, b), lattice.levels, strict=True))
    values = lattice.values if unchanged else replace(lattice, input_matrix=None).cube_values(grid((r, g, b)))

    matrix = lattice.input_matrix
    to_axes = () if matrix is None else (Matrix(matrix[:, :3], matrix[:, 3]), Range())
    curve = () if is_even((r, g, b)) else (shaper((r, g, b), entries or MAX_SHAPER_SIZE),)
    output_curve = () if lattice.output_curve is None else (Curve(lattice.output_curve),)
    return *to_axes, *curve, Cube(values, lattice.interpolation), *output_curve
