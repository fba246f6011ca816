"""A nonuniform lattice: a 3D lookup table whose node levels lie where the function bends (thesis, chapter 5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import ProfileError
from lutforge.interpolation import Interpolation, Levels, interpolate


@dataclass(frozen=True, eq=False)
class Lattice:
    """Node levels per axis and the output value at each node; evaluation only.

    levels: three strictly increasing (N,) float64 arrays; values: (N_r, N_g, N_b, 3) float64.
    Raises ProfileError where the shapes disagree, a level does not increase, or a number is not finite.
    """

    levels: Levels
    values: NDArray[np.float64]
    interpolation: Interpolation = "trilinear"

    def __post_init__(self) -> None:
        shape = (*(len(axis) for axis in self.levels), 3)
        if self.values.shape != shape:
            raise ProfileError(f"lattice: values have shape {self.values.shape}, the node levels ask for {shape}")
        for name, axis in zip("RGB", self.levels, strict=True):
            if len(axis) < 2 or not np.all(np.isfinite(axis)) or not np.all(np.diff(axis) > 0):
                raise ProfileError(f"lattice: the {name} node levels are not strictly increasing numbers")
        if not np.all(np.isfinite(self.values)):
            raise ProfileError("lattice: a node value is not a finite number")

    def __call__(self, x: ArrayLike) -> NDArray[np.float64]:
        """Interpolate at `x` (…, 3), clamped to the domain; returns (…, 3) float64."""
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


def grid(levels: Levels) -> NDArray[np.float64]:
    """All node positions, (N_r, N_g, N_b, 3)."""
    return np.stack(np.meshgrid(*levels, indexing="ij"), axis=-1)
