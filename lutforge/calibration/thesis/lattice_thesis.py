"""The lattice fit as the thesis has it (5.3): uniform fit, error histogram, α by the fitting error, final fit."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from lutforge.calibration.lattice.lattice_result import LatticeResult, result, snapped
from lutforge.calibration.options import THESIS, CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, uniform_levels
from lutforge.solvers.lattice_regression import LatticeFit, Regularisation, fit_lattice, predict
from lutforge.solvers.node_levels import blended_levels, error_histogram

Array = NDArray[np.float64]

ALPHA_TOLERANCE = 1e-4
ALPHAS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where the search for α begins (5.10): the error over α has more than one minimum."""


def fit_thesis(x: Array, y: Array, options: CalibrationOptions, *, clips: bool) -> LatticeResult:
    """x (n, 3) → y (n, 3); clips: the boundary term applies (render). α by the fitting error over [0, 1] (5.10)."""
    regularisation = THESIS if clips else Regularisation(anchor=0.0)
    method = options.interpolation
    first = fit_lattice(x, y, snapped(uniform_levels(options.size), options), regularisation, method=method)

    def done(fit: LatticeFit) -> LatticeResult:
        return result(Lattice(fit.levels, fit.values, method), x, y, regularisation.smoothness)

    if not options.nonuniform:
        return done(first)
    histograms = error_histogram(x, np.sum((predict(first, x, method) - y) ** 2, axis=1))
    fits: dict[float, tuple[float, Levels, Array]] = {}

    def fitting_error(alpha: float) -> float:
        levels = snapped(blended_levels(histograms, alpha, options.size), options)
        start = fits[min(fits, key=lambda other: abs(other - alpha))][2] if fits else first.values
        fit = fit_lattice(x, y, levels, regularisation, method=method, start=start, tolerance=ALPHA_TOLERANCE)
        error = float(np.sum((predict(fit, x, method) - y) ** 2))
        fits[alpha] = (error, levels, fit.values)
        return error

    coarse = [fitting_error(alpha) for alpha in ALPHAS]
    best = int(np.argmin(coarse))
    bounds = (ALPHAS[max(best - 1, 0)], ALPHAS[min(best + 1, len(ALPHAS) - 1)])
    minimize_scalar(fitting_error, bounds=bounds, method="bounded", options={"xatol": 0.02})
    _, levels, start = min(fits.values(), key=lambda entry: entry[0])
    return done(fit_lattice(x, y, levels, regularisation, method=method, start=start))
