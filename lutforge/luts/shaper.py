"""The 1D part of a nonuniform LUT: a curve per axis that spreads the node levels evenly (thesis, chapter 5).

s_c(L_c(i)) = i / (N − 1), linear in between. Sampled at M uniform points on [0, 1] it stays exact, since the
node levels are among the points: readers interpolate linearly between samples.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Levels

SHAPER_SIZE = 65536
"""Entries of a sampled shaper: the most that DaVinci Resolve and OpenColorIO read in a .cube file."""

SHAPER_SIZES = (4096, SHAPER_SIZE)
"""What a lattice's node levels are looked for on: profiles snap theirs to the first, which keeps files small."""


def sampled_shaper(levels: Levels, size: int = SHAPER_SIZE) -> NDArray[np.float64]:
    """The curves s_c at `size` uniform points on [0, 1]: (size, 3) in [0, 1]."""
    x = np.arange(size) / (size - 1)
    return np.stack([np.interp(x, axis, np.arange(len(axis)) / (len(axis) - 1)) for axis in levels], axis=1)


def on_grid(axis: NDArray[np.float64], size: int) -> bool:
    """True where every node level is one of the points of a sampled shaper of `size` entries."""
    points = axis * (size - 1)
    return bool(np.all(np.abs(points - np.rint(points)) < 1e-6))


def scaled_levels(axis: NDArray[np.float64], gain: float, size: int) -> NDArray[np.float64]:
    """Node levels L / gain, moved to the points of a shaper of `size` entries, each to one of its own.

    The last may lie before or beyond 1; it is rounded up, so that all that the camera clips stays clipped.
    """
    scaled = axis / gain * (size - 1)
    points = np.rint(scaled).astype(np.int64)
    points[-1] = int(np.ceil(scaled[-1] - 1e-6))
    order = np.arange(len(axis))
    points = np.maximum.accumulate(points - order) + order
    return points / (size - 1)
