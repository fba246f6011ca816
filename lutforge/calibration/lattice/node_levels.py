"""Node levels close together where the errors of a lattice are large (thesis 5.6 – 5.9; de Boor 1973)."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from lutforge.arrays import Array
from lutforge.interpolation import Levels
from lutforge.model.gamut_map import to_even
from lutforge.model.lattice import equidistribute

BINS = 1000
"""Bins of the error histogram (thesis 5.3)."""
EVEN_DENSITY = np.full(BINS, 0.1 / BINS)
"""The density of a tenth of the levels, which stays evenly spread: no stretch without samples is left without nodes."""


def even_to_the_eye(share: float, offset: float) -> Array:
    """Return the density (BINS,) of a share of the levels that is spread evenly to the eye.

    offset: ε of that scale (`model.gamut_map`).
    """
    return np.asarray(share * np.diff(to_even(np.linspace(0.0, 1.0, BINS + 1), offset)))


def equidistributed_levels(x: Array, error: Array, levels: Levels, floor: Array = EVEN_DENSITY) -> Levels:
    """Return as many better node levels, from the squared errors (n,) of a lattice at `levels` over x (n, 3).

    An interval of width h with curvature κ and sample density ρ carries a squared error e ≈ ρ κ² h⁴ per unit length; at
    a fixed number of intervals the total is least where 1/h ∝ (ρ κ²)^(1/5) (de Boor 1973,
    https://doi.org/10.1007/BFb0069390, for weighted L2). So the error histogram and the present spacing give ρ κ², from
    which follows the spacing that balances it. A few rounds converge; (5.6 – 5.9) is one such round with exponent 1.

    floor: (BINS,), the density of the share of the levels that lies there whatever the errors. Beyond 0 and 1 no errors
    are assumed: with mirrored ones the ends take levels that the middle needs more (D40, 17³: 0.0042 for 0.0040).
    """
    histograms = gaussian_filter1d(normalized_histogram(x, error), 40.0, radius=160, mode="constant")
    middles = (np.arange(BINS) + 0.5) / BINS
    densities = []
    for histogram, axis in zip(histograms, levels, strict=True):
        spacing = np.diff(axis)[np.searchsorted(axis[1:-1], middles, side="right")] * (len(axis) - 1)
        noise = 0.01 / BINS  # a hundredth of the error counts as even noise
        densities.append(((histogram + noise) / np.square(spacing) ** 2) ** (1 / 5))
    smooth = gaussian_filter1d(np.array(densities), 5.0, radius=20, mode="nearest")
    smooth = (1 - floor.sum()) * smooth / smooth.sum(axis=1, keepdims=True) + floor
    r, g, b = (equidistribute(row, len(axis)) for row, axis in zip(smooth, levels, strict=True))
    return (r, g, b)


def normalized_histogram(x: Array, error: Array) -> Array:
    """Histograms (3, BINS), of sum 1, of errors (n,) over the positions x (n, 3)."""
    bins = np.clip((x * BINS).astype(np.int64), 0, BINS - 1)
    counts = np.stack([np.bincount(column, weights=error, minlength=BINS) for column in bins.T])
    total = counts[0].sum()
    return counts / total if total > 0 else np.full((3, BINS), 1.0 / BINS)
