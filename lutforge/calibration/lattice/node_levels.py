"""Node levels close together where the errors of a lattice are large, and the lattice fit of the thesis (5.3).

That is a uniform fit, its error histogram, α by the fitting error, and a final fit.
"""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.interpolation import Levels, interpolate
from lutforge.model.gamut_map import to_even
from lutforge.model.lattice import Lattice, equidistribute, snapped, uniform_levels
from lutforge.solvers.lattice_regression import Regularization, fit_lattice

BINS = 1000
"""Bins of the error histogram (thesis 5.3)."""
EVEN = np.full(BINS, 0.1 / BINS)
"""The density of a tenth of the levels, which stays evenly spread: no stretch without samples is left without nodes."""
THESIS = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-6)
"""λ_S, λ_A and λ_K of section 5.3."""


def error_histogram(x: Array, error: Array) -> tuple[Array, Array, Array]:
    """Return per axis the normalized histogram (BINS,) of squared errors (n,) over the sample positions (n, 3).

    Equation 5.6, smoothed by the Gaussian of (5.7), 40 bins wide, whose width the thesis does not state. Errors are
    mirrored at 0 and 1, so that smoothing loses none of them there.
    """
    r, g, b = gaussian_filter1d(_normalized(x, error), 40.0, radius=160, mode="reflect")
    return r, g, b


def even_to_the_eye(share: float, offset: float) -> Array:
    """Return the density (BINS,) of a share of the levels that is spread evenly to the eye.

    offset: ε of that scale (`model.gamut_map`).
    """
    return np.asarray(share * np.diff(to_even(np.linspace(0.0, 1.0, BINS + 1), offset)))


def equidistributed_levels(x: Array, error: Array, levels: Levels, floor: Array = EVEN) -> Levels:
    """Return as many better node levels, from the squared errors (n,) of a lattice at `levels` over x (n, 3).

    An interval of width h with curvature κ and sample density ρ carries a squared error e ≈ ρ κ² h⁴ per unit length; at
    a fixed number of intervals the total is least where 1/h ∝ (ρ κ²)^(1/5) (de Boor 1973,
    https://doi.org/10.1007/BFb0069390, for weighted L2). So the error histogram and the present spacing give ρ κ², and
    that the spacing which balances it. A few rounds converge; (5.6 – 5.9) is one such round with exponent 1.

    floor: (BINS,), the density of the share of the levels that lies there whatever the errors. Beyond 0 and 1 no errors
    are assumed: with mirrored ones the ends take levels that the middle needs more (D40, 17³: 0.0042 for 0.0040).
    """
    histograms = gaussian_filter1d(_normalized(x, error), 40.0, radius=160, mode="constant")
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


def _normalized(x: Array, error: Array) -> Array:
    """(3, BINS): histograms of sum 1."""
    bins = np.clip((x * BINS).astype(np.int64), 0, BINS - 1)
    counts = np.stack([np.bincount(column, weights=error, minlength=BINS) for column in bins.T])
    total = counts[0].sum()
    return counts / total if total > 0 else np.full((3, BINS), 1.0 / BINS)


def fit_uniform(x: Array, y: Array, options: CalibrationOptions) -> Lattice:
    """Fit a lattice with evenly spaced nodes to samples x → y (n, 3), as the thesis's comparison does: by λ_K alone."""
    regularization = Regularization(thin_plate=THESIS.thin_plate)
    return _uniform(x, y, options, regularization)


def fit_thesis(x: Array, y: Array, options: CalibrationOptions, *, clips: bool) -> Lattice:
    """Fit a lattice to samples x → y (n, 3), its node levels with the α of least fitting error over [0, 1] (5.10).

    clips: the boundary term applies, as to render. With options.nonuniform off the nodes are evenly spaced.
    """
    regularization = THESIS if clips else replace(THESIS, anchor=0.0)
    method = options.interpolation
    first = _uniform(x, y, options, regularization)
    if not options.nonuniform:
        return first
    histograms = error_histogram(x, np.sum((first(x) - y) ** 2, axis=1))
    fits: dict[float, tuple[float, Levels, Array]] = {}

    def fitting_error(alpha: float) -> float:
        levels = snapped(blended_levels(histograms, alpha, options.size), options.shaper_size)
        start = fits[min(fits, key=lambda other: abs(other - alpha))][2] if fits else first.values
        nodes = fit_lattice(x, y, levels, regularization, method=method, start=start, tolerance=1e-4).value
        error = float(np.sum((interpolate(x, levels, nodes, method) - y) ** 2))
        fits[alpha] = (error, levels, nodes)
        return error

    alphas = (0.0, 0.25, 0.5, 0.75, 1.0)  # the error over α has more than one minimum
    best = int(np.argmin([fitting_error(alpha) for alpha in alphas]))
    bounds = (alphas[max(best - 1, 0)], alphas[min(best + 1, len(alphas) - 1)])
    # Every fit on the way is kept, so that the least of them is taken however the search ends.
    minimize_scalar(fitting_error, bounds=bounds, method="bounded", options={"xatol": 0.02})
    _, levels, start = min(fits.values(), key=lambda entry: entry[0])
    return Lattice(levels, fit_lattice(x, y, levels, regularization, method=method, start=start).value, method)


def blended_levels(histograms: tuple[Array, Array, Array], alpha: float, size: int) -> Levels:
    """Return node levels L_c(i; α) from the histogram blended with a constant, α·Gauss(hist) + (1 − α)/N_bin (5.7)."""
    r, g, b = (equidistribute(alpha * hist + (1 - alpha) / BINS, size) for hist in histograms)
    return (r, g, b)


def _uniform(x: Array, y: Array, options: CalibrationOptions, regularization: Regularization) -> Lattice:
    levels, method = snapped(uniform_levels(options.size), options.shaper_size), options.interpolation
    return Lattice(levels, fit_lattice(x, y, levels, regularization, method=method).value, method)
