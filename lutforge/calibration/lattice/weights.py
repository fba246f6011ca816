"""How much a sample counts in the fit of a lattice."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.lattice.output_curve import OutputCurve
from lutforge.calibration.lattice_options import LatticeFitOptions
from lutforge.interpolation import through
from lutforge.solvers.robust_weights import RobustWeights, cauchy


def outlier_weights(squared_error: Array, options: LatticeFitOptions) -> Array:
    """Return IRLS weights in [0, 1] of samples with these squared errors (n,)."""
    return RobustWeights(cauchy, options.outlier_scale, options.least_outlier)(np.sqrt(squared_error))


def curve_weights(curve: OutputCurve, y: Array) -> Array:
    """Return how much an error of the cube counts behind the curve at y (n, 3), (n,); 1 in the median."""
    codes = np.linspace(0.0, 1.0, 511)[:, None].repeat(3, axis=1)  # two codes of 255 a step
    slope = through(curve.slope(codes), y)  # tabulated: y may hold millions
    square = squares(slope)
    return np.asarray(square / np.median(square))


def squares(difference: Array) -> Array:
    """Return the squared lengths (n,) of differences (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", difference, difference))


def search_rows(count: int, size: int) -> NDArray[np.intp]:
    """Return the samples to search with, the same ones every time, for a lattice of `size` nodes per axis.

    They are at most two a node, and 50,000.
    """
    most = min(50_000, 2 * size**3)
    if count <= most:
        return np.arange(count)
    return np.random.default_rng(0).choice(count, most, replace=False, shuffle=False)
