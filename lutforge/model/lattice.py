"""A nonuniform lattice: a 3D lookup table whose node levels lie where the function bends (thesis, chapter 5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import ProfileError
from lutforge.interpolation import Interpolation, Levels, interpolate, through


@dataclass(frozen=True, eq=False)
class Lattice:
    """Node levels per axis and the output value at each node; evaluation only.

    levels: three strictly increasing (N,) float64 arrays; values: (N_r, N_g, N_b, 3) float64. response: (m, 3), the
    output at m even steps of [0, 1] of the interpolated values, clamped; none for none. plain: the same function fitted
    without a response, for files that can hold none.
    Raises ProfileError where the shapes disagree, a level does not increase, a response falls, or a number is not
    finite or absurd.
    """

    levels: Levels
    values: Array
    interpolation: Interpolation = "trilinear"
    response: Array | None = None
    plain: "Lattice | None" = None

    def __post_init__(self) -> None:
        shape = (*(len(axis) for axis in self.levels), 3)
        if self.values.shape != shape:
            raise ProfileError(f"lattice: values have shape {self.values.shape}, the node levels ask for {shape}")
        for name, axis in zip("RGB", self.levels, strict=True):
            if len(axis) < 2 or not np.all(np.isfinite(axis)) or not np.all(np.diff(axis) > 0):
                raise ProfileError(f"lattice: the {name} node levels are not strictly increasing numbers")
        if not np.all(np.isfinite(self.values)):
            raise ProfileError("lattice: a node value is not a finite number")
        if np.abs(self.values).max() > 1e4:  # colours on [0, 1], and what a fit makes of corners without samples
            raise ProfileError(f"lattice: a node value of {np.abs(self.values).max():.3g} is no colour")
        if self.response is not None:
            table = self.response
            if table.ndim != 2 or table.shape[1] != 3 or not 2 <= len(table) <= 1 << 16:  # as the 1D tables of CLF
                raise ProfileError("lattice: the response is not a table of rows of three numbers")
            if not np.all(np.isfinite(table)) or np.any(np.diff(table, axis=0) < 0):
                raise ProfileError("lattice: the response falls, or holds what is not a number")
            if np.abs(table).max() > 1e4:
                raise ProfileError(f"lattice: a response of {np.abs(table).max():.3g} is no colour")
        if self.plain is not None and (self.plain.response is not None or self.plain.plain is not None):
            raise ProfileError("lattice: the plain form has a response")

    def __call__(self, x: ArrayLike) -> Array:
        """Evaluate at `x` (…, 3), clamped to the domain; returns (…, 3) float64."""
        values = self.inner(x)
        return values if self.response is None else through(self.response, values)

    def inner(self, x: ArrayLike) -> Array:
        """The interpolated values at `x` (…, 3), before the response."""
        return interpolate(x, self.levels, self.values, self.interpolation)

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
