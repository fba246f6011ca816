"""Where the node levels of a nonuniform lattice lie (thesis 5.3, equations 5.6 – 5.9)."""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from lutforge.errors import LutError
from lutforge.interpolation import Levels

Array = NDArray[np.float64]

BINS = 1000
"""Bins of the error histogram (thesis 5.3)."""
SMOOTHING = 20.0
"""Standard deviation in bins of the Gaussian that smooths it; the thesis does not state its own."""


def error_histogram(x: Array, error: Array) -> tuple[Array, Array, Array]:
    """Per axis the smoothed, normalised histogram (BINS,) of squared errors (n,) over the sample positions (n, 3).

    (5.6), smoothed by the Gaussian of (5.7).
    """
    histograms = []
    for axis in range(3):
        counts, _ = np.histogram(x[:, axis], bins=BINS, range=(0.0, 1.0), weights=error)
        total = counts.sum()
        flat = counts / total if total > 0 else np.full(BINS, 1.0 / BINS)
        histograms.append(gaussian_filter1d(flat, SMOOTHING, mode="constant"))
    r, g, b = histograms
    return r, g, b


def equidistribute(density: Array, size: int) -> Array:
    """`size` levels on [0, 1] with equal mass of a piecewise-constant positive density between neighbours (5.8, 5.9)."""
    mass = np.concatenate([[0.0], np.cumsum(density)])
    levels = np.interp(np.linspace(0.0, 1.0, size), mass / mass[-1], np.linspace(0.0, 1.0, len(mass)))
    levels[0], levels[-1] = 0.0, 1.0
    return levels


def blended_levels(histograms: tuple[Array, Array, Array], alpha: float, size: int) -> Levels:
    """Node levels L_c(i; α) from the histogram blended with a constant, hist* = α·Gauss(hist) + (1 − α)/N_bin (5.7)."""
    r, g, b = (equidistribute(alpha * hist + (1 - alpha) / BINS, size) for hist in histograms)
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
