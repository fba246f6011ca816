"""The lattice of one style and direction, fitted to samples: node levels, weights and values (thesis, chapter 5)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from lutforge.calibration.options import THESIS, CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.regression.lattice_regression import LatticeFit, Prior, Regularisation, fit_lattice, predict
from lutforge.regression.node_levels import (
    blended_levels,
    equidistributed_levels,
    error_histogram,
    resized_levels,
    snap_levels,
)
from lutforge.regression.normal_equations import normal_equations

Array = NDArray[np.float64]
Guess = Callable[[Array], Array]
"""What the lattice should be where there are no samples: node positions (…, 3) → values (…, 3)."""

SMOOTHNESS_GRID = (1e-3, 1e-2, 1e-1, 1.0)
DEFAULT_SMOOTHNESS = 1e-2
"""Where there is one shot only, and nothing to cross-validate on."""
SEARCH_SAMPLES = 50_000
SEARCH_SIZE = 17
SEARCH_TOLERANCE = 1e-4
ROUNDS = 6
FOLDS = 5
HOLD = 1.0
"""Weight that holds black, and white where the camera clips, to the guess: no sample can lie there."""
OUTLIER_SCALE = 10.0
"""A sample whose error is this many times the median counts half (Cauchy)."""
LEAST_OUTLIER = 12.0 / 255.0


@dataclass(frozen=True, eq=False)
class LatticeResult:
    """lattice; coverage: summed sample weight per node (N_r, N_g, N_b); smoothness: λ_S used; rms: on the samples."""

    lattice: Lattice
    coverage: Array
    smoothness: float
    rms: float


def fit_samples(
    x: Array,
    y: Array,
    groups: NDArray[np.str_],
    guess: Guess,
    options: CalibrationOptions,
    *,
    clips: bool,
    smoothness: float | None = None,
) -> LatticeResult:
    """Fit x (n, 3) → y (n, 3), both in [0, 1]; groups (n,): the shot of each sample.

    clips: the camera clips in this direction (render), so values that the guess clips are held there, and the thesis's
    boundary term applies. smoothness: λ_S where it is known already; else it is cross-validated over the groups.
    """
    if options.preset == "thesis":
        regularisation = THESIS if clips else Regularisation(anchor=0.0)
        return _fit_thesis(x, y, options, regularisation)
    if smoothness is None:
        smoothness = _choose_smoothness(x, y, groups, guess, options, clips)
    problem = _Problem(x, y, guess, options, clips, smoothness)
    levels, weight = problem.search(options.size)
    snapped = _snap(levels, options)
    return _result(problem.fit(snapped, weight, tolerance=1e-8), x, y, options, smoothness)


def _snap(levels: Levels, options: CalibrationOptions) -> Levels:
    r, g, b = (snap_levels(axis, options.shaper_size) for axis in levels)
    return (r, g, b)


def _result(fit: LatticeFit, x: Array, y: Array, options: CalibrationOptions, smoothness: float) -> LatticeResult:
    ones = np.ones_like(x)
    coverage = normal_equations(x, ones, fit.levels, options.interpolation).right[..., 0]
    values = fit.values
    if options.preset == "lutforge":
        # A node that no sample touches may not leave the range of colours; the others carry on across the clipping,
        # which the camera does after the smooth function that they describe.
        values = np.where(coverage[..., None] > 0, values, np.clip(values, 0.0, 1.0))
    lattice = Lattice(fit.levels, values, options.interpolation)
    rms = float(np.sqrt(np.mean(np.sum((lattice(x) - y) ** 2, axis=1))))
    return LatticeResult(lattice, np.ascontiguousarray(coverage), smoothness, rms)


# --- the thesis's own fit -------------------------------------------------------------------------------------------


def _fit_thesis(x: Array, y: Array, options: CalibrationOptions, regularisation: Regularisation) -> LatticeResult:
    """Uniform fit, error histogram, α by the fitting error over [0, 1] (5.10), final fit on the snapped levels."""
    method = options.interpolation
    uniform = uniform_levels(options.size)
    first = fit_lattice(x, y, _snap(uniform, options), regularisation, method=method)
    if not options.nonuniform:
        return _result(first, x, y, options, regularisation.smoothness)
    histograms = error_histogram(x, np.sum((predict(first, x, method) - y) ** 2, axis=1))
    start: Array | None = first.values

    def fitting_error(alpha: float) -> float:
        nonlocal start
        levels = blended_levels(histograms, alpha, options.size)
        fit = fit_lattice(x, y, levels, regularisation, method=method, start=start, tolerance=SEARCH_TOLERANCE)
        start = fit.values
        return float(np.sum((predict(fit, x, method) - y) ** 2))

    alpha = float(minimize_scalar(fitting_error, bounds=(0.0, 1.0), method="bounded", options={"xatol": 0.02}).x)
    levels = _snap(blended_levels(histograms, alpha, options.size), options)
    return _result(
        fit_lattice(x, y, levels, regularisation, method=method, start=start),
        x,
        y,
        options,
        regularisation.smoothness,
    )


# --- LutForge's fit -------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same while levels and weights are searched."""

    x: Array
    y: Array
    guess: Guess
    options: CalibrationOptions
    clips: bool
    smoothness: float

    def fit(
        self,
        levels: Levels,
        weight: Array | None,
        *,
        tolerance: float,
        start: Array | None = None,
    ) -> LatticeFit:
        values = np.clip(self.guess(grid(levels)), 0.0, 1.0)
        hold = np.zeros_like(values)
        hold[0, 0, 0] = HOLD
        if self.clips:
            hold[-1, -1, -1] = HOLD
        return fit_lattice(
            self.x,
            self.y,
            levels,
            Regularisation(self.smoothness, twist=self.smoothness, anchor=0.0, thin_plate=0.0),
            method=self.options.interpolation,
            weight=weight,
            prior=Prior(values, hold),
            start=start,
            tolerance=tolerance,
        )

    def search(self, size: int) -> tuple[Levels, Array]:
        """Node levels by rounds of equidistribution, and the robust weight of each sample; the best round is kept.

        Large lattices take the levels of a small one, refined: the density that the rounds find has no size.
        """
        if size > SEARCH_SIZE:
            levels, weight = self.search(SEARCH_SIZE)
            return resized_levels(levels, size), weight
        subset = _Problem(*_subset(self.x, self.y), self.guess, self.options, self.clips, self.smoothness)
        levels = uniform_levels(size)
        fit = subset.fit(levels, None, tolerance=SEARCH_TOLERANCE)
        error = subset.squared_error(fit)
        best = (float(np.mean(error)), levels, fit)
        for _ in range(ROUNDS if self.options.nonuniform else 0):
            levels = equidistributed_levels(subset.x, error, levels)
            fit = subset.fit(levels, _robust(error), tolerance=SEARCH_TOLERANCE, start=fit.values)
            error = subset.squared_error(fit)
            mean = float(np.sum(_robust(error) * error) / len(error))
            stalled = mean > 0.97 * best[0]
            if mean < best[0]:
                best = (mean, levels, fit)
            if stalled:
                break
        return best[1], _robust(self.squared_error(best[2]))

    def squared_error(self, fit: LatticeFit) -> Array:
        error: Array = np.sum((predict(fit, self.x, self.options.interpolation) - self.y) ** 2, axis=1)
        return error


def _robust(squared_error: Array) -> Array:
    """Cauchy weights in [0, 1] of samples with these squared errors (n,)."""
    scale = max(OUTLIER_SCALE * float(np.sqrt(np.median(squared_error))), LEAST_OUTLIER)
    weight: Array = 1.0 / (1.0 + squared_error / scale**2)
    return weight


def _subset(x: Array, y: Array) -> tuple[Array, Array]:
    """At most SEARCH_SAMPLES of the samples, the same ones every time."""
    if len(x) <= SEARCH_SAMPLES:
        return x, y
    rows = np.random.default_rng(0).permutation(len(x))[:SEARCH_SAMPLES]
    return x[rows], y[rows]


def folds(groups: NDArray[np.str_], most: int = FOLDS) -> Iterator[NDArray[np.bool_]]:
    """Masks of held-out samples: whole shots, never parts of one; one fold a shot, or `most` folds of several shots.

    Shots are dealt out in order of their sample counts, so that folds are of like size.
    """
    names, counts = np.unique(groups, return_counts=True)
    order = names[np.argsort(-counts, kind="stable")]
    count = min(most, len(order))
    for fold in range(count):
        yield np.isin(groups, order[fold::count])


def _choose_smoothness(
    x: Array, y: Array, groups: NDArray[np.str_], guess: Guess, options: CalibrationOptions, clips: bool
) -> float:
    """λ_S with the least error on held-out shots, on a small lattice."""
    if len(np.unique(groups)) < 2:
        return DEFAULT_SMOOTHNESS
    size = min(options.size, SEARCH_SIZE)
    rows = np.arange(len(x))
    if len(rows) > SEARCH_SAMPLES:
        rows = np.random.default_rng(0).permutation(len(x))[:SEARCH_SAMPLES]
    levels, _ = _Problem(x[rows], y[rows], guess, options, clips, DEFAULT_SMOOTHNESS).search(size)
    masks = [mask for mask in folds(groups[rows]) if 0 < mask.sum() < len(mask)]
    scores = []
    for smoothness in SMOOTHNESS_GRID:
        total = 0.0
        for mask in masks:
            train = _Problem(x[rows][~mask], y[rows][~mask], guess, options, clips, smoothness)
            fit = train.fit(levels, None, tolerance=SEARCH_TOLERANCE)
            error = np.sum((predict(fit, x[rows][mask], options.interpolation) - y[rows][mask]) ** 2, axis=1)
            total += float(np.sum(_robust(error) * error))
        scores.append(total)
    return SMOOTHNESS_GRID[int(np.argmin(scores))]
