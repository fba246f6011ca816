"""A nonuniform lattice: a 3D lookup table whose node levels lie where the function bends (thesis, chapter 5).

Its node levels come from a density, from those of another number, or lie on the grid of a shaper.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.errors import LutError, ProfileError
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate

SHORT_SHAPER_SIZE = 4096
"""Entries of a short shaper. The node levels of profiles are snapped to its grid, so that it holds them exactly."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """Node levels per axis and the output value at each node; evaluation only.

    levels: three strictly increasing (N,) float64 arrays; values: (N_r, N_g, N_b, 3) float64. input_matrix: (3, 4) maps
    colours x to the axes, A x + b with A its first three columns, or None where they are the axes' own. output_curve:
    (m, 3), after the interpolated values, at m even steps from 0 to 1, or None; it is not the camera response f.
    Raises ProfileError where the shapes disagree, a level does not increase, an output curve falls, a matrix cannot be
    inverted, or a number is not finite or absurd.
    """

    levels: Levels
    values: Array
    interpolation: Interpolation = "trilinear"
    output_curve: Array | None = None
    input_matrix: Array | None = None

    def __post_init__(self) -> None:
        shape = (*(len(axis) for axis in self.levels), 3)
        if self.values.shape != shape:
            raise ProfileError(f"lattice: values have shape {self.values.shape}, the node levels ask for {shape}")
        for name, axis in zip("RGB", self.levels, strict=True):
            if axis.ndim != 1 or len(axis) < 2 or not np.all(np.isfinite(axis)) or not np.all(np.diff(axis) > 0):
                raise ProfileError(f"lattice: the {name} node levels are not strictly increasing numbers")
        if not np.all(np.isfinite(self.values)):
            raise ProfileError("lattice: a node value is not a finite number")
        if np.abs(self.values).max() > 1e4:  # colours on [0, 1], and what a fit makes of corners without samples
            raise ProfileError(f"lattice: a node value of {np.abs(self.values).max():.3g} is no colour")
        if self.output_curve is not None:
            table = self.output_curve
            if table.ndim != 2 or table.shape[1] != 3 or not 2 <= len(table) <= 1 << 16:  # as the 1D tables of CLF
                raise ProfileError("lattice: the output curve is not a table of rows of three numbers")
            if not np.all(np.isfinite(table)) or np.any(np.diff(table, axis=0) < 0):
                raise ProfileError("lattice: the output curve falls, or holds what is not a number")
            if np.abs(table).max() > 1e4:
                raise ProfileError(f"lattice: an output curve of {np.abs(table).max():.3g} is no colour")
        if self.input_matrix is not None:
            matrix = self.input_matrix
            if matrix.shape != (3, 4) or not np.all(np.abs(matrix) < 1e4) or np.linalg.cond(matrix[:, :3]) > 1e6:
                raise ProfileError("lattice: the matrix before it is not 3 × 4 numbers that can be inverted")

    def __repr__(self) -> str:
        return f"Lattice({'×'.join(map(str, self.size))}, {self.interpolation})"

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at `x` (…, 3), clamped to the domain; returns (…, 3) float64."""
        values = self.cube_values(x)
        return values if self.output_curve is None else apply_curve(self.output_curve, values)

    def cube_values(self, x: ArrayLike) -> Array:
        """The interpolated values at `x` (…, 3), before the output curve."""
        return interpolate(self.on_axes(x), self.levels, self.values, self.interpolation)

    def on_axes(self, x: ArrayLike) -> Array:
        """Take colours (…, 3) to the axes of the lattice."""
        colours = np.asarray(x, dtype=np.float64)
        if self.input_matrix is None:
            return colours
        return np.asarray(colours @ self.input_matrix[:, :3].T + self.input_matrix[:, 3])

    def from_axes(self, places: Array) -> Array:
        """Take places on the axes (…, 3) to colours, within [0, 1]."""
        if self.input_matrix is None:
            return places
        inverse = np.linalg.inv(self.input_matrix[:, :3])
        return np.clip((places - self.input_matrix[:, 3]) @ inverse.T, 0.0, 1.0)

    @property
    def size(self) -> tuple[int, int, int]:
        """Nodes per axis."""
        r, g, b = self.levels
        return (len(r), len(g), len(b))


def uniform_levels(size: int) -> Levels:
    """The node levels of a uniform lattice on [0, 1]."""
    axis = np.linspace(0.0, 1.0, size)
    return (axis, axis.copy(), axis.copy())


def grid(levels: Levels) -> Array:
    """All node positions, (N_r, N_g, N_b, 3)."""
    r, g, b = levels
    positions = np.empty((len(r), len(g), len(b), 3))
    positions[..., 0], positions[..., 1], positions[..., 2] = r[:, None, None], g[:, None], b
    return positions


def equidistribute(density: Array, size: int) -> Array:
    """Place `size` levels on [0, 1] with equal mass of a stepwise positive density between neighbours.

    Equations 5.8 and 5.9 of the thesis.
    """
    mass = np.concatenate([[0.0], np.cumsum(density)])
    levels = np.interp(np.linspace(0.0, 1.0, size), mass / mass[-1], np.linspace(0.0, 1.0, len(mass)))
    levels[0], levels[-1] = 0.0, 1.0
    return levels


def resized_levels(levels: Levels, size: int) -> Levels:
    """Place another number of levels with the same density: the level function is interpolated monotonically."""
    import scipy  # imported here: what only looks a lattice up never needs it

    resized = []
    for axis in levels:
        if len(axis) == size:
            resized.append(axis)
            continue
        curve = scipy.interpolate.PchipInterpolator(np.linspace(0.0, 1.0, len(axis)), axis)
        resized.append(np.asarray(curve(np.linspace(0.0, 1.0, size)), dtype=np.float64))
        resized[-1][0], resized[-1][-1] = axis[0], axis[-1]
    r, g, b = resized
    return (r, g, b)


def snap_levels(levels: Array, shaper_size: int) -> Array:
    """Move one axis of node levels to multiples of 1 / (shaper_size − 1), so that a sampled shaper holds them exactly.

    levels: (N,) from 0 to 1. Each level keeps a grid point of its own; the ends stay 0 and 1.
    Raises LutError where the grid has fewer points than there are levels.
    """
    steps, count = shaper_size - 1, len(levels)
    if count > shaper_size:
        raise LutError(f"{count} node levels need a shaper of at least {count} entries; this one has {shaper_size}")
    points = np.rint(np.asarray(levels) * steps).astype(np.int64)
    points[0], points[-1] = 0, steps
    order = np.arange(count)
    # Push up from below, then down from above: the smallest moves that make the points distinct.
    points = np.maximum.accumulate(points - order) + order
    points = np.minimum.accumulate((np.minimum(points, steps) - order)[::-1])[::-1] + order
    return points / steps


def with_level_at(levels: Levels, place: Array) -> Levels:
    """Node levels of which the nearest one of each axis is moved to a place (3,); the ends of an axis stay."""
    axes = []
    for axis, at in zip(levels, place, strict=True):
        moved = axis.copy()
        if at not in axis:
            moved[1 + int(np.argmin(np.abs(axis[1:-1] - at)))] = at
        axes.append(moved)
    r, g, b = axes
    return r, g, b


def nodes_at(levels: Levels, place: Array) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """The index of the nodes that lie at a place (3,); of none where it is no level of an axis."""
    r, g, b = np.ix_(*(np.flatnonzero(axis == at) for axis, at in zip(levels, place, strict=True)))
    return r, g, b


def snapped(levels: Levels, shaper_size: int) -> Levels:
    """Node levels of three axes on the grid of the shaper that files will hold them in. Raises LutError."""
    r, g, b = (snap_levels(axis, shaper_size) for axis in levels)
    return (r, g, b)
