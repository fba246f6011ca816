"""The thesis's lattice regression (5.3): a uniform fit, its error histogram, α by the fitting error, a last fit."""

from dataclasses import replace

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array
from lutforge.calibration.lattice.node_levels import BINS, normalized_histogram
from lutforge.calibration.options import LatticeOptions
from lutforge.interpolation import Levels, interpolate
from lutforge.model.lattice import Lattice, equidistribute, snapped, uniform_levels
from lutforge.solvers.lattice_regression import Regularization, fit_lattice

THESIS = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-6)
"""λ_S, λ_A and λ_K of section 5.3."""


def error_histogram(x: Array, error: Array) -> tuple[Array, Array, Array]:
    """Return per axis the normalized histogram (BINS,) of squared errors (n,) over the sample positions (n, 3).

    Equation 5.6, smoothed by the Gaussian of (5.7), 40 bins wide, whose width the thesis does not state. Errors are
    mirrored at 0 and 1, so that smoothing loses none of them there.
    """
    r, g, b = gaussian_filter1d(normalized_histogram(x, error), 40.0, radius=160, mode="reflect")
    return r, g, b


def fit_uniform(x: Array, y: Array, options: LatticeOptions) -> Lattice:
    """Fit a lattice with evenly spaced nodes to samples x → y (n, 3), as the thesis's comparison does: by λ_K alone."""
    regularization = Regularization(thin_plate=THESIS.thin_plate)
    return _uniform(x, y, options, regularization)


def fit_thesis(x: Array, y: Array, options: LatticeOptions, *, clips: bool) -> Lattice:
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
        start = fits[min(fits, key=lambda fitted_alpha: abs(fitted_alpha - alpha))][2] if fits else first.values
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


def _uniform(x: Array, y: Array, options: LatticeOptions, regularization: Regularization) -> Lattice:
    """Fit a lattice with evenly spaced nodes to samples x → y (n, 3)."""
    levels = snapped(uniform_levels(options.size), options.shaper_size)
    method = options.interpolation
    return Lattice(levels, fit_lattice(x, y, levels, regularization, method=method).value, method)
