"""Node levels of a lattice's axes: from a density, of another number, and on the grid of a shaper."""

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Levels


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
