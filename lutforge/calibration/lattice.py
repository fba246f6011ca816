"""The lattice of one style and direction, fitted to samples: node levels, weights and values (thesis, chapter 5)."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from lutforge.calibration.continuation import Continuation
from lutforge.calibration.lattice_result import LatticeResult, result, snapped
from lutforge.calibration.lattice_thesis import fit_thesis
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.output_curve import OutputCurve
from lutforge.interpolation import Levels, interpolate, through
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.regression.blas import one_blas_thread
from lutforge.regression.lattice_regression import LatticeFit, Prior, Regularisation, predict, solve_lattice
from lutforge.regression.node_levels import equidistributed_levels, resized_levels
from lutforge.regression.normal_equations import NormalEquations, normal_equations

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
TOLERANCE = 1e-6
MEASURING_TOLERANCE = 1e-4
"""Of fits whose only use is to measure an error: within 1e-4 of the exact ones on every sample."""
ROUNDS = 6
FOLDS = 5
SEARCH_FOLDS = 3
HOLD = 1e3
"""Weight that holds black to 0, and white to 1 where the camera clips: no sample can lie there."""
LEAST_HOLD = 1e-5
"""Weight that holds every node: next to a sample nothing, but what no sample can tell is the guess."""
FARTHEST = (-1.0, 2.0)
"""Bounds of the guess behind which a curve clamps to [0, 1]."""
GREY = np.linspace(0.0, 1.0, 257)[:, None].repeat(3, axis=1)
GREY_WEIGHTS = np.full(len(GREY), 0.02)
"""What a point of the grey axis counts beside a sample: where there are samples nothing, else it keeps it neutral."""
RISING_WEIGHT = 30.0
"""What it counts where the fit would fall along the axis."""
RISING_ROUNDS = 4
RISING_TOLERANCE = 1e-5
LEAST_FALL = 1e-6
OUTLIER_SCALE = 10.0
"""A sample whose error is this many times the median counts half (Cauchy)."""
LEAST_OUTLIER = 12.0 / 255.0


@one_blas_thread
def fit_samples(
    x: Array,
    y: Array,
    groups: NDArray[np.str_],
    guess: Guess,
    options: CalibrationOptions,
    *,
    clips: bool,
    curve: OutputCurve | None = None,
    smoothness: float | None = None,
    tolerance: float = TOLERANCE,
) -> LatticeResult:
    """Fit x (n, 3) → y (n, 3), both in [0, 1]; groups (n,): the shot of each sample.

    clips: the camera clips in this direction (render), so values that the guess clips are held there, and the thesis's
    boundary term applies. curve: what comes behind the cube, in the output's encoding; errors count after it.
    smoothness: λ_S where it is known already; else it is cross-validated over the groups.
    tolerance: relative residual of the last solve.
    """
    if options.preset == "thesis":
        return fit_thesis(x, y, options, clips=clips)
    target = y if curve is None else curve.enter(y)
    weight = np.ones(len(x)) if curve is None else _weight(curve, y)
    chosen = DEFAULT_SMOOTHNESS if smoothness is None else smoothness
    problem = _Problem(x, y, target, weight, guess, options, clips, chosen, curve)
    rows = _subset(len(x))
    search = problem.select(rows, guess)
    first = search.first_robust
    levels = search.levels(uniform_levels(min(SEARCH_SIZE, options.size)), ROUNDS)
    if smoothness is None:
        search = replace(search, smoothness=_choose_smoothness(search, groups[rows], levels))
        problem = replace(problem, smoothness=search.smoothness)
    levels = resized_levels(levels, options.size) if options.nonuniform else uniform_levels(options.size)
    fit = search.fit(levels, first, SEARCH_TOLERANCE)
    if options.nonuniform:
        levels = equidistributed_levels(search.x, search.squared_error(fit), levels)
    levels = snapped(levels, options)
    start = interpolate(grid(levels), fit.levels, fit.values)
    final = problem.rising_fit(levels, _robust(problem.squared_error(fit)), start, tolerance)
    return result(problem.lattice(final), x, y, problem.smoothness)


@dataclass(frozen=True, eq=False)
class _Problem:
    """What stays the same while levels and weights are searched, for n samples.

    x, y: (n, 3); target: what the cube should give, (n, 3); weight: how much its error counts behind the curve, (n,).
    """

    x: Array
    y: Array
    target: Array
    weight: Array
    guess: Guess
    options: CalibrationOptions
    clips: bool
    smoothness: float
    curve: OutputCurve | None

    def leave_out(self, held: list[NDArray[np.bool_]]) -> "list[_Problem]":
        """The problems of the samples that are not of each mask, with guesses that have not seen those."""
        if isinstance(self.guess, Continuation):
            guesses: list[Guess] = [*self.guess.leave_out(self.x, self.y, held)]
        else:
            guesses = [self.guess] * len(held)
        return [self.select(~mask, guess) for mask, guess in zip(held, guesses, strict=True)]

    def select(self, rows: NDArray[np.intp] | NDArray[np.bool_], guess: Guess) -> "_Problem":
        """The problem of some of the samples, with another guess."""
        return replace(
            self, x=self.x[rows], y=self.y[rows], target=self.target[rows], weight=self.weight[rows], guess=guess
        )

    @cached_property
    def first_robust(self) -> Array:
        """(n,): robust weights before any lattice is fitted, from the guess, which no stray sample bends."""
        error: Array = np.sum((np.clip(self.guess(self.x), 0.0, 1.0) - self.y) ** 2, axis=1)
        return _robust(error)

    @cached_property
    def grey(self) -> Array:
        """What the cube should give on GREY: neutral, as bright as matrix and response make it on average."""
        plain = replace(self.guess, gamut_map=None) if isinstance(self.guess, Continuation) else self.guess
        values = np.clip(plain(GREY), 0.0, 1.0).mean(axis=1, keepdims=True).repeat(3, axis=1)
        return values if self.curve is None else self.curve.enter(values)

    def prior(self, levels: Levels) -> Prior:
        positions = grid(levels)
        if self.curve is None:
            values = np.clip(self.guess(positions), 0.0, 1.0)
        elif isinstance(self.guess, Continuation):
            values = np.clip(self.curve.continued(self.guess.mapped(positions)), *FARTHEST)
        else:
            values = self.curve.enter(np.clip(self.guess(positions), 0.0, 1.0))
        hold = np.full_like(values, LEAST_HOLD)
        values[0, 0, 0], hold[0, 0, 0] = 0.0, HOLD
        if self.clips:
            # Behind a curve white may lie beyond 1: the cube need not turn back to it.
            values[-1, -1, -1] = 1.0 if self.curve is None else np.maximum(values[-1, -1, -1], 1.0)
            hold[-1, -1, -1] = HOLD
        return Prior(values, hold)

    def equations(self, levels: Levels, prior: Prior, weight: Array) -> NormalEquations:
        """W'ΩW and W'Ω(y − W b₀) of the samples; weight: (n,) beside the curve's own."""
        return self._summed(self.x, self.target, levels, prior, self.weight * weight)

    def with_grey(
        self, equations: NormalEquations, levels: Levels, prior: Prior, values: Array, weight: Array
    ) -> NormalEquations:
        """The same with values on the grey axis, (257, 3), of weights (257,)."""
        grey = self._summed(GREY, values, levels, prior, weight)
        return NormalEquations(equations.stencil + grey.stencil, equations.right + grey.right)

    def _summed(self, x: Array, y: Array, levels: Levels, prior: Prior, weight: Array) -> NormalEquations:
        method = self.options.interpolation
        return normal_equations(x, y - interpolate(x, levels, prior.values, method), levels, method, weight)

    def solve(
        self, equations: NormalEquations, levels: Levels, prior: Prior, start: Array | None, tolerance: float
    ) -> LatticeFit:
        smoothness = self.smoothness * len(levels[0]) / SEARCH_SIZE
        regularisation = Regularisation(smoothness, twist=smoothness, anchor=0.0, thin_plate=0.0)
        return solve_lattice(equations, levels, regularisation, prior=prior, start=start, tolerance=tolerance)

    def fit(self, levels: Levels, weight: Array, tolerance: float, like: LatticeFit | None = None) -> LatticeFit:
        """The fit; like: one at other levels, to start from."""
        prior = self.prior(levels)
        start = None if like is None else interpolate(grid(levels), like.levels, like.values)
        equations = self.with_grey(self.equations(levels, prior, weight), levels, prior, self.grey, GREY_WEIGHTS)
        return self.solve(equations, levels, prior, start, tolerance)

    def rising_fit(self, levels: Levels, weight: Array, start: Array, tolerance: float) -> LatticeFit:
        """The fit, again with the isotonic regression of its own grey axis while that falls anywhere."""
        prior = self.prior(levels)
        values, grey_weight = self.grey.copy(), GREY_WEIGHTS.copy()
        samples = self.equations(levels, prior, weight)
        for _ in range(RISING_ROUNDS):
            equations = self.with_grey(samples, levels, prior, values, grey_weight)
            fit = self.solve(equations, levels, prior, start, tolerance)
            axis = np.clip(predict(fit, GREY, self.options.interpolation), 0.0, 1.0)
            if np.diff(axis, axis=0).min() >= -LEAST_FALL:
                break
            rising = np.stack([isotonic_regression(channel).x for channel in axis.T], axis=1)
            falls = np.any(np.abs(rising - axis) > 0.1 * LEAST_FALL, axis=1)
            values[falls], grey_weight[falls] = rising[falls], RISING_WEIGHT
            start, tolerance = fit.values, max(tolerance, RISING_TOLERANCE)
        return fit

    def levels(self, start: Levels, rounds: int) -> Levels:
        """Better node levels by rounds of equidistribution, samples weighted by their error; the best round's."""
        levels, weight, best = start, self.first_robust, (np.inf, start)
        fit: LatticeFit | None = None
        for _ in range(rounds + 1):
            fit = self.fit(levels, weight, SEARCH_TOLERANCE, fit)
            error = self.squared_error(fit)
            weight = _robust(error)
            mean = float(np.mean(weight * error))
            stalled = mean > 0.97 * best[0]
            best = min(best, (mean, levels), key=lambda entry: entry[0])
            if stalled:
                break
            levels = equidistributed_levels(self.x, error, levels)
        return best[1]

    def squared_error(self, fit: LatticeFit) -> Array:
        """(n,) of the output, behind the curve."""
        values = predict(fit, self.x, self.options.interpolation)
        error: Array = np.sum(((values if self.curve is None else self.curve.leave(values)) - self.y) ** 2, axis=1)
        return error

    def lattice(self, fit: LatticeFit) -> Lattice:
        """The fit, as profiles keep it."""
        method = self.options.interpolation
        values = fit.values.copy()
        values[0, 0, 0] = 0.0  # what the weight that holds them leaves over
        if self.clips:
            values[-1, -1, -1] = 1.0 if self.curve is None else np.maximum(values[-1, -1, -1], 1.0)
        if self.curve is not None:
            return Lattice(fit.levels, values, method, self.curve.table)
        # A node that no sample touches may not leave the range of colours; the others carry on across the clipping,
        # which the camera does after the smooth function that they describe.
        touched = normal_equations(self.x, np.ones_like(self.x), fit.levels, method).right > 0
        return Lattice(fit.levels, np.where(touched, values, np.clip(values, 0.0, 1.0)), method)


def _weight(curve: OutputCurve, y: Array) -> Array:
    """(n,): how much an error of the cube counts behind the curve at y (n, 3); 1 in the median."""
    codes = np.linspace(0.0, 1.0, len(curve.table))[:, None].repeat(3, axis=1)
    square = np.mean(through(curve.slope(codes), y) ** 2, axis=1)  # tabulated: y may hold millions
    return np.asarray(square / np.median(square))


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
    tests = [problem.select(mask, problem.guess) for mask in masks]
    trains = problem.leave_out(masks)
    priors = [train.prior(levels) for train in trains]
    equations = [
        train.with_grey(train.equations(levels, prior, train.first_robust), levels, prior, train.grey, GREY_WEIGHTS)
        for train, prior in zip(trains, priors, strict=True)
    ]
    starts = [prior.values for prior in priors]

    def held_out_error(smoothness: float) -> float:
        total = 0.0
        for fold, test in enumerate(tests):
            train = replace(trains[fold], smoothness=smoothness)
            fit = train.solve(equations[fold], levels, priors[fold], starts[fold], SEARCH_TOLERANCE)
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
