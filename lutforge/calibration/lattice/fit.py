"""The lattice of one style and direction, fitted to samples in stages (thesis, chapter 5, and beyond).

`fit_samples` states the problem, searches node levels and λ_S on a small lattice and few samples, fits a lattice of the
size that is wanted to tell its errors, and from these takes the final levels and weights, with which it fits once more.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.lattice.output_curve import OutputCurve
from lutforge.calibration.lattice.plain import fit_plain
from lutforge.calibration.lattice.problem import (
    LatticeProblem,
    PlacedProblem,
    PriorMean,
    curve_weights,
    outlier_weights,
    search_rows,
)
from lutforge.calibration.lattice.result import LatticeResult, result, snapped
from lutforge.calibration.options import SEARCH_SIZE, CalibrationOptions
from lutforge.calibration.thesis.lattice import fit_thesis
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, resized_levels, uniform_levels
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.cross_validation import descend, leave_groups_out
from lutforge.solvers.lattice_regression import LatticeFit


def choose_smoothness(
    problem: LatticeProblem, groups: NDArray[np.str_], levels: Levels, points: tuple[Array, Array] | None = None
) -> float:
    """Return the λ_S of least error on held-out shots; that of the options where no shot can be held out.

    groups: (n,), the shot of each sample; points: x and y (m, 3) that every fit follows beside its samples, and that
    make much smoothness needless. The search walks in steps of √10: the error is flat near its minimum. Two folds
    choose the same λ_S as five do; of a lattice smaller than SEARCH_SIZE one of them does, in half the time.
    """
    options = problem.options.lattice
    masks = [mask for mask in leave_groups_out(groups, 2) if 0 < mask.sum() < len(mask)]
    masks = masks[: 1 if problem.options.size < SEARCH_SIZE else 2]
    if not masks:
        return options.smoothness
    tests = [problem.select(mask, problem.prior_mean).at(levels) for mask in masks]
    others = problem.leave_out(masks)
    trains = [(train if points is None else train.with_points(*points)).at(levels) for train in others]
    sure = np.ones(0 if points is None else len(points[0]))
    equations = [
        train.with_grey(train.equations(np.concatenate([problem.first_robust[~mask], sure])), problem.grey)
        for train, mask in zip(trains, masks, strict=True)
    ]
    starts = [train.prior.values for train in trains]

    def held_out_error(smoothness: float) -> float:
        total = 0.0
        for fold, (train, test) in enumerate(zip(trains, tests, strict=True)):
            beside = smoothness * train.problem.smoothness / problem.smoothness  # more where there are points, too
            fit = train.solve(equations[fold], train.prior, beside, starts[fold], options.search_tolerance)
            starts[fold] = fit.values
            error = test.squared_error(fit)
            total += float(np.sum(outlier_weights(error, options) * error))
        return total

    return descend(held_out_error, options.smoothness, 10**0.5, (1e-4, 10.0))


@one_blas_thread
def fit_samples(
    x: Array,
    y: Array,
    groups: NDArray[np.str_],
    prior_mean: PriorMean,
    options: CalibrationOptions,
    *,
    clips: bool,
    curve: OutputCurve | None = None,
    points: tuple[Array, Array] | None = None,
    smoothness: float | None = None,
    like: LatticeResult | None = None,
    tolerance: float | None = None,
) -> LatticeResult:
    """Fit a lattice to samples x (n, 3) → y (n, 3), both in [0, 1]; groups (n,): the shot of each sample.

    prior_mean: what the lattice follows where it has no samples. clips: the camera clips in this direction (render), so
    values that the prior mean clips are held there, and the thesis's boundary term applies. curve: what comes behind
    the cube, in the output's encoding; errors count after it. With options.output_curve off, the result is the plain
    form of that fit. points: x and y (m, 3) that the lattice follows beside the samples.
    smoothness: λ_S where it is known already; else it is cross-validated over the groups. like: a fit to samples of the
    same camera, whose λ_S and node levels are taken; nothing is searched then.
    tolerance: relative residual of the last solve; that of the options where None.
    """
    if options.preset == "thesis":
        return fit_thesis(x, y, options, clips=clips)
    target = y if curve is None else curve.to_values(y)
    weight = np.ones(len(x)) if curve is None else curve_weights(curve, y)
    begin = options.lattice.smoothness if smoothness is None else smoothness
    problem = LatticeProblem(x, y, target, weight, prior_mean, options, clips, begin, curve)
    rows = search_rows(len(x), options.size)
    search = problem if len(rows) == len(x) else problem.select(rows, prior_mean)
    levels = search.levels(min(SEARCH_SIZE, options.size)) if like is None else like.lattice.levels
    if like is not None:
        chosen = like.smoothness
    else:
        chosen = begin if smoothness is not None else choose_smoothness(search, groups[rows], levels, points)
    same = search is problem
    problem = replace(problem, smoothness=chosen)
    search = problem if same else replace(search, smoothness=chosen)
    if points is not None:
        problem = problem.with_points(*points)
        rows = search_rows(len(problem.x), options.size)
        search = problem if len(rows) == len(problem.x) else problem.select(rows, prior_mean)
        levels = search.levels(min(SEARCH_SIZE, options.size)) if like is None else levels
    found = _search(search, levels) if like is None else _fit_at(search, levels)
    lattice = _final_fit(problem, found, tolerance)
    if curve is not None and not options.output_curve:
        return fit_plain(x, y, lattice, options, chosen)
    return result(lattice, x, chosen)


@dataclass(frozen=True, eq=False)
class _Search:
    """The result of the search.

    levels: the best node levels; placed: the problem at the levels before these; fit: the last one, of that problem;
    error: its squared errors.
    """

    levels: Levels
    placed: PlacedProblem
    fit: LatticeFit
    error: Array


def _fit_at(problem: LatticeProblem, levels: Levels, like: LatticeFit | None = None) -> _Search:
    """Fit to the tolerance of the search, at levels that stay. like: a fit at other levels, to start from."""
    placed = problem.at(levels)
    fit = placed.fit(problem.first_robust, problem.options.lattice.search_tolerance, like)
    return _Search(levels, placed, fit, placed.squared_error(fit))


def _search(problem: LatticeProblem, levels: Levels) -> _Search:
    """Fit a lattice of SEARCH_SIZE and one of the size that is wanted.

    The levels of each follow the errors of the one before.
    """
    options, found = problem.options, None
    for size in sorted({min(SEARCH_SIZE, options.size), options.size}):
        levels = resized_levels(levels, size) if options.nonuniform else uniform_levels(size)
        found = _fit_at(problem, levels, None if found is None else found.fit)
        if options.nonuniform:
            levels = problem.moved_levels(levels, found.error)
    assert found is not None
    return replace(found, levels=levels)


def _final_fit(problem: LatticeProblem, found: _Search, tolerance: float | None) -> Lattice:
    """Fit once more to all samples, with weights from the errors of the search."""
    options, placed, error = problem.options, found.placed, found.error
    if placed.problem is not problem:
        placed = problem.at(found.fit.levels)
        error = placed.squared_error(found.fit)
    levels = snapped(found.levels, options)
    if not all(map(np.array_equal, levels, placed.levels)):
        placed = problem.at(levels)
    weight, start = outlier_weights(error, options.lattice), placed.moved(found.fit).values
    return placed.lattice(placed.rising_fit(weight, start, tolerance or options.lattice.tolerance))
