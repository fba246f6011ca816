"""The lattice of one style and direction, fitted to samples: node levels, weights and values (thesis, chapter 5)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from lutforge.calibration.continuation import Continuation
from lutforge.calibration.options import THESIS, CalibrationOptions
from lutforge.interpolation import Levels, interpolate
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.regression.blas import one_blas_thread
from lutforge.regression.lattice_regression import (
    LatticeFit,
    Prior,
    Regularisation,
    fit_lattice,
    predict,
    solve_lattice,
)
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

DEFAULT_SMOOTHNESS = 3e-3
"""λ_S of the search lattice where there is one shot only, and nothing to cross-validate on."""
SMOOTHNESS_STEP = 10**0.5
SMOOTHNESS_RANGE = (1e-4, 10.0)
SEARCH_SIZE = 13
"""Levels and λ_S are searched on a lattice of this size first: the best levels hardly depend on their number."""
SEARCH_SAMPLES = 50_000
SEARCH_TOLERANCE = 1e-2
TOLERANCE = 1e-7
MEASURING_TOLERANCE = 1e-4
"""Of fits whose only use is to measure an error: within 1e-4 of the exact ones on every sample."""
ROUNDS = 6
FOLDS = 5
SEARCH_FOLDS = 3
HOLD = 1e3
"""Weight that holds black to 0, and white to 1 where the camera clips: no sample can lie there."""
LEAST_HOLD = 1e-5
"""Weight that holds every node: next to a sample nothing, but what no sample can tell is the guess."""
OUTLIER_SCALE = 10.0
"""A sample whose error is this many times the median counts half (Cauchy)."""
LEAST_OUTLIER = 12.0 / 255.0
ALPHA_TOLERANCE = 1e-4
ALPHAS = (0.0, 0.25, 0.5, 0.75, 1.0)
"""Where the search for α begins (5.10): the error over α has more than one minimum."""


@dataclass(frozen=True, eq=False)
class LatticeResult:
    """A lattice; coverage: summed sample weight per node (N_r, N_g, N_b); rms: on the samples.

    smoothness: the λ_S that was chosen, of a lattice of SEARCH_SIZE nodes per axis; a lattice of N has N / SEARCH_SIZE
    times that, which weighs the same curvature alike.
    """

    lattice: Lattice
    coverage: Array
    smoothness: float
    rms: float


@one_blas_thread
def fit_samples(
    x: Array,
    y: Array,
    groups: NDArray[np.str_],
    guess: Guess,
    options: CalibrationOptions,
    *,
    clips: bool,
    smoothness: float | None = None,
    tolerance: float = TOLERANCE,
) -> LatticeResult:
    """Fit x (n, 3) → y (n, 3), both in [0, 1]; groups (n,): the shot of each sample.

    clips: the camera clips in this direction (render), so values that the guess clips are held there, and the thesis's
    boundary term applies. smoothness: λ_S where it is known already; else it is cross-validated over the groups.
    tolerance: relative residual of the last solve.
    """
    if options.preset == "thesis":
        regularisation = THESIS if clips else Regularisation(anchor=0.0)
        return _fit_thesis(x, y, options, regularisation)
    problem = _Problem(x, y, guess, options, clips, DEFAULT_SMOOTHNESS if smoothness is None else smoothness)
    rows = _subset(len(x))
    search = replace(problem, x=x[rows], y=y[rows])
    levels = search.levels(uniform_levels(min(SEARCH_SIZE, options.size)), ROUNDS)
    if smoothness is None:
        search = replace(search, smoothness=_choose_smoothness(search, groups[rows], levels))
        problem = replace(problem, smoothness=search.smoothness)
    levels = resized_levels(levels, options.size) if options.nonuniform else uniform_levels(options.size)
    fit = search.fit(levels, None, tolerance=SEARCH_TOLERANCE)
    if options.nonuniform:
        levels = equidistributed_levels(search.x, search.squared_error(fit), levels)
    levels = _snap(levels, options)
    start = interpolate(grid(levels), fit.levels, fit.values)
    final = problem.fit(levels, _robust(problem.squared_error(fit)), start=start, tolerance=tolerance)
    return _result(final, x, y, options, problem.smoothness)


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
    fits: dict[float, tuple[float, Levels, Array]] = {}

    def fitting_error(alpha: float) -> float:
        levels = _snap(blended_levels(histograms, alpha, options.size), options)
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
    final = fit_lattice(x, y, levels, regularisation, method=method, start=start)
    return _result(final, x, y, options, regularisation.smoothness)


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

    def select(self, rows: NDArray[np.intp] | NDArray[np.bool_]) -> "_Problem":
        """The problem of some of the samples, whose guess has not seen the others."""
        x, y = self.x[rows], self.y[rows]
        return replace(
            self, x=x, y=y, guess=self.guess.refit(x, y) if isinstance(self.guess, Continuation) else self.guess
        )

    def prior(self, levels: Levels) -> Prior:
        values = np.clip(self.guess(grid(levels)), 0.0, 1.0)
        hold = np.full_like(values, LEAST_HOLD)
        values[0, 0, 0], hold[0, 0, 0] = 0.0, HOLD
        if self.clips:
            values[-1, -1, -1], hold[-1, -1, -1] = 1.0, HOLD
        return Prior(values, hold)

    def regularisation(self, size: int) -> Regularisation:
        smoothness = self.smoothness * size / SEARCH_SIZE
        return Regularisation(smoothness, twist=smoothness, anchor=0.0, thin_plate=0.0)

    def fit(self, levels: Levels, weight: Array | None, *, start: Array | None = None, tolerance: float) -> LatticeFit:
        return fit_lattice(
            self.x,
            self.y,
            levels,
            self.regularisation(len(levels[0])),
            method=self.options.interpolation,
            weight=weight,
            prior=self.prior(levels),
            start=start,
            tolerance=tolerance,
        )

    def levels(self, start: Levels, rounds: int) -> Levels:
        """Better node levels by rounds of equidistribution, samples weighted by their error; the best round's."""
        levels, weight, best = start, None, (np.inf, start)
        for _ in range(rounds + 1):
            error = self.squared_error(self.fit(levels, weight, tolerance=SEARCH_TOLERANCE))
            weight = _robust(error)
            mean = float(np.mean(weight * error))
            stalled = mean > 0.97 * best[0]
            best = min(best, (mean, levels), key=lambda entry: entry[0])
            if stalled:
                break
            levels = equidistributed_levels(self.x, error, levels)
        return best[1]

    def squared_error(self, fit: LatticeFit) -> Array:
        error: Array = np.sum((predict(fit, self.x, self.options.interpolation) - self.y) ** 2, axis=1)
        return error


def _robust(squared_error: Array) -> Array:
    """Cauchy weights in [0, 1] of samples with these squared errors (n,)."""
    scale = max(OUTLIER_SCALE * float(np.sqrt(np.median(squared_error))), LEAST_OUTLIER)
    weight: Array = 1.0 / (1.0 + squared_error / scale**2)
    return weight


def _subset(count: int) -> NDArray[np.intp]:
    """At most SEARCH_SAMPLES of the samples, the same ones every time."""
    if count <= SEARCH_SAMPLES:
        return np.arange(count)
    return np.random.default_rng(0).permutation(count)[:SEARCH_SAMPLES]


def folds(groups: NDArray[np.str_], most: int = FOLDS) -> Iterator[NDArray[np.bool_]]:
    """Masks of held-out samples: whole shots, never parts of one; one fold a shot, or `most` folds of several shots.

    Shots are dealt out in order of their sample counts, so that folds are of like size.
    """
    names, counts = np.unique(groups, return_counts=True)
    order = names[np.argsort(-counts, kind="stable")]
    count = min(most, len(order))
    for fold in range(count):
        yield np.isin(groups, order[fold::count])


def _choose_smoothness(problem: _Problem, groups: NDArray[np.str_], levels: Levels) -> float:
    """λ_S with the least error on held-out shots: from the default, downhill in steps of √10 while it gets better."""
    masks = [mask for mask in folds(groups, SEARCH_FOLDS) if 0 < mask.sum() < len(mask)]
    if len(masks) < 2:
        return DEFAULT_SMOOTHNESS
    method = problem.options.interpolation
    tests = [replace(problem, x=problem.x[mask], y=problem.y[mask]) for mask in masks]
    priors, equations = [], []
    for mask in masks:
        train = problem.select(~mask)
        prior = train.prior(levels)
        offset = interpolate(train.x, levels, prior.values, method)
        priors.append(prior)
        equations.append(normal_equations(train.x, train.y - offset, levels, method))
    starts = [prior.values for prior in priors]

    def held_out_error(smoothness: float) -> float:
        total = 0.0
        regularisation = replace(problem, smoothness=smoothness).regularisation(len(levels[0]))
        for fold, test in enumerate(tests):
            fit = solve_lattice(
                equations[fold],
                levels,
                regularisation,
                prior=priors[fold],
                start=starts[fold],
                tolerance=SEARCH_TOLERANCE,
            )
            starts[fold] = fit.values
            error = test.squared_error(fit)
            total += float(np.sum(_robust(error) * error))
        return total

    best, least = DEFAULT_SMOOTHNESS, held_out_error(DEFAULT_SMOOTHNESS)
    for factor in (SMOOTHNESS_STEP, 1 / SMOOTHNESS_STEP):
        while SMOOTHNESS_RANGE[0] <= best * factor <= SMOOTHNESS_RANGE[1]:
            error = held_out_error(best * factor)
            if error >= least:
                break
            best, least = best * factor, error
        if best != DEFAULT_SMOOTHNESS:
            break
    return best
