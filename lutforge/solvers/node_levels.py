"""Where the node levels of a nonuniform lattice lie (thesis 5.3, equations 5.6 – 5.9)."""

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from lutforge.compiled import compiled
from lutforge.errors import LutError
from lutforge.interpolation import Levels

Array = NDArray[np.float64]

BINS = 1000
"""Bins of the error histogram (thesis 5.3)."""
SMOOTHING = 40.0
"""Standard deviation in bins of the Gaussian that smooths it; the thesis does not state its own."""
RADIUS = 160
"""Of that Gaussian: four standard deviations."""


def error_histogram(x: Array, error: Array) -> tuple[Array, Array, Array]:
    """Per axis the smoothed, normalised histogram (BINS,) of squared errors (n,) over the sample positions (n, 3).

    (5.6), smoothed by the Gaussian of (5.7).
    """
    counts = _histograms(np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(error, dtype=np.float64))
    total = counts[0].sum()
    flat = counts / total if total > 0 else np.full((3, BINS), 1.0 / BINS)
    none = np.zeros((3, RADIUS))
    r, g, b = _smoothed(np.concatenate([none, flat, none], axis=1), GAUSSIAN)
    return r, g, b


@compiled()
def _histograms(x: Array, error: Array) -> Array:
    counts = np.zeros((3, BINS))
    for n in range(len(x)):
        for axis in range(3):
            counts[axis, min(max(int(x[n, axis] * BINS), 0), BINS - 1)] += error[n]
    return counts


def _gaussian(deviation: float, radius: int) -> Array:
    """A Gaussian of that standard deviation, cut off at `radius`, (2 radius + 1,), of sum 1."""
    weights = np.exp(-0.5 * (np.arange(-radius, radius + 1) / deviation) ** 2)
    return np.asarray(weights / weights.sum())


@compiled(fastmath={"contract"})
def _smoothed(padded: Array, kernel: Array) -> Array:
    """Rows (m, n + len(kernel) − 1) under a symmetric kernel, (m, n)."""
    count = padded.shape[1] - len(kernel) + 1
    result = np.zeros((len(padded), count))
    for row in range(len(padded)):
        to, radius = result[row], len(kernel) // 2
        for bin in range(count):
            to[bin] = kernel[radius] * padded[row, radius + bin]
        for k in range(radius):
            weight, left = kernel[k], padded[row, k : k + count]
            right = padded[row, len(kernel) - 1 - k : len(kernel) - 1 - k + count]
            for bin in range(count):
                to[bin] += weight * (left[bin] + right[bin])
    return result


def equidistribute(density: Array, size: int) -> Array:
    """`size` levels on [0, 1] with equal mass of a stepwise positive density between neighbours (5.8, 5.9)."""
    mass = np.concatenate([[0.0], np.cumsum(density)])
    levels = np.interp(np.linspace(0.0, 1.0, size), mass / mass[-1], np.linspace(0.0, 1.0, len(mass)))
    levels[0], levels[-1] = 0.0, 1.0
    return levels


def blended_levels(histograms: tuple[Array, Array, Array], alpha: float, size: int) -> Levels:
    """Node levels L_c(i; α) from the histogram blended with a constant, hist* = α·Gauss(hist) + (1 − α)/N_bin (5.7)."""
    r, g, b = (equidistribute(alpha * hist + (1 - alpha) / BINS, size) for hist in histograms)
    return (r, g, b)


SMOOTH = 4
"""An interval of width h with curvature κ and sample density ρ carries a squared error of ρ κ² h⁴ per unit length; at a
fixed number of intervals the total is least where 1/h ∝ (ρ κ²)^(1/5) (de Boor 1973, for weighted L2)."""
FLOOR = 0.1
"""Share of the levels that stays evenly spread, so that no stretch without samples is left without nodes."""
DENSITY_SMOOTHING = 5.0
"""Standard deviation in bins of the Gaussian that smooths the density of levels."""
BACKGROUND = 0.01
"""Share of the error that counts as even noise."""
MIDDLES = (np.arange(BINS) + 0.5) / BINS
EVEN = np.full(BINS, FLOOR / BINS)
"""The density of those levels."""
GAUSSIAN, DENSITY_GAUSSIAN = _gaussian(SMOOTHING, RADIUS), _gaussian(DENSITY_SMOOTHING, 20)


def equidistributed_levels(x: Array, error: Array, levels: Levels, order: int = SMOOTH, floor: Array = EVEN) -> Levels:
    """Better node levels of the same number, from the squared errors (n,) of a lattice at `levels` over x (n, 3).

    Per axis the error histogram e(t) ≈ ρ κ² h⁴ gives ρ κ² = e / h⁴ with the present spacing h, and so the spacing that
    balances it. A few rounds converge; (5.6 – 5.9) is one such round with exponent 1, tempered by α.
    order: the power of h that the error grows with, less where the function has kinks; floor: (BINS,), the density of
    the share of the levels that lies there whatever the errors.
    """
    densities = []
    for histogram, axis in zip(error_histogram(x, error), levels, strict=True):
        spacing = np.diff(axis)[np.searchsorted(axis[1:-1], MIDDLES, side="right")] * (len(axis) - 1)
        densities.append(((histogram + BACKGROUND / BINS) / np.square(spacing) ** (order / 2)) ** (1 / (order + 1)))
    radius = len(DENSITY_GAUSSIAN) // 2
    density = np.array(densities)
    before, after = (density[:, [end]].repeat(radius, axis=1) for end in (0, -1))
    smooth = _smoothed(np.concatenate([before, density, after], axis=1), DENSITY_GAUSSIAN)
    smooth = (1 - floor.sum()) * smooth / smooth.sum(axis=1, keepdims=True) + floor
    r, g, b = (equidistribute(row, len(axis)) for row, axis in zip(smooth, levels, strict=True))
    return (r, g, b)


def resized_levels(levels: Levels, size: int) -> Levels:
    """Node levels of another number that follow the same density: the level function, interpolated monotonically."""
    resized = []
    for axis in levels:
        if len(axis) == size:
            resized.append(axis)
            continue
        curve = PchipInterpolator(np.linspace(0.0, 1.0, len(axis)), axis)
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
