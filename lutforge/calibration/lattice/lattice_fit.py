"""The lattice of one style and direction, fitted to samples: node levels, weights and values (thesis, chapter 5)."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.lattice.lattice_problem import (
    GREY_WEIGHTS,
    SEARCH_SIZE,
    SEARCH_TOLERANCE,
    Guess,
    LatticeProblem,
    curve_weights,
    robust_weights,
    search_rows,
)
from lutforge.calibration.lattice.lattice_result import LatticeResult, result, snapped
from lutforge.calibration.lattice.output_curve import OutputCurve
from lutforge.calibration.lattice.plain_lattice import fit_plain
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.thesis.lattice_thesis import fit_thesis
from lutforge.interpolation import Levels
from lutforge.model.lattice import uniform_levels
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.cross_validation import descend, leave_groups_out
from lutforge.solvers.lattice_regression import LatticeFit
from lutforge.solvers.node_levels import resized_levels

Array = NDArray[np.float64]

DEFAULT_SMOOTHNESS = 3e-3
"""λ_S of the search lattice where there is one shot only, and nothing to cross-validate on."""
SMOOTHNESS_STEP = 10**0.5
SMOOTHNESS_RANGE = (1e-4, 10.0)
TOLERANCE = 1e-5
MEASURING_TOLERANCE = 1e-4
"""Of fits whose only use is to measure an error: within 1e-4 of the exact ones on every sample."""
SEARCH_FOLDS = 2
"""More of them choose the same λ_S: its steps are wide. Of them a lattice smaller than that of the search holds one
out, which chooses as well there, in half the time."""


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
    boundary term applies. curve: what comes behind the cube, in the output's encoding; errors count after it. With
    options.response off, the result is the plain form of that fit.
    smoothness: λ_S where it is known already; else it is cross-validated over the groups.
    tolerance: relative residual of the last solve.
    """
    if options.preset == "thesis":
        return fit_thesis(x, y, options, clips=clips)
    target = y if curve is None else curve.enter(y)
    weight = np.ones(len(x)) if curve is None else curve_weights(curve, y)
    chosen = DEFAULT_SMOOTHNESS if smoothness is None else smoothness
    problem = LatticeProblem(x, y, target, weight, guess, options, clips, chosen, curve)
    rows = search_rows(len(x), options.size)
    search = problem if len(rows) == len(x) else problem.select(rows, guess)
    first = search.first_robust
    levels = search.levels(min(SEARCH_SIZE, options.size))
    if smoothness is None:
        search = replace(search, smoothness=_choose_smoothness(search, groups[rows], levels))
        problem = replace(problem, smoothness=search.smoothness)
    fit: LatticeFit | None = None
    for size in sorted({min(SEARCH_SIZE, options.size), options.size}):
        levels = resized_levels(levels, size) if options.nonuniform else uniform_levels(size)
        placed = search.at(levels)
        fit = placed.fit(first, SEARCH_TOLERANCE, fit)
        error = placed.squared_error(fit)
        if options.nonuniform:
            levels = search.moved_levels(levels, error)
    assert fit is not None
    robust = robust_weights(error if len(rows) == len(x) else problem.at(fit.levels).squared_error(fit))
    placed = problem.at(snapped(levels, options))
    lattice = placed.lattice(placed.rising_fit(robust, placed.moved(fit).values, tolerance))
    if curve is not None and not options.response:
        return fit_plain(x, y, lattice, options, problem.smoothness)
    return result(lattice, x, y, problem.smoothness)


def _choose_smoothness(problem: LatticeProblem, groups: NDArray[np.str_], levels: Levels) -> float:
    """λ_S with the least error on held-out shots: from the default, downhill in steps of √10 while it gets better."""
    masks = [mask for mask in leave_groups_out(groups, SEARCH_FOLDS) if 0 < mask.sum() < len(mask)]
    masks = masks[: 1 if problem.options.size < SEARCH_SIZE else SEARCH_FOLDS]
    if not masks:
        return DEFAULT_SMOOTHNESS
    tests = [problem.select(mask, problem.guess).at(levels) for mask in masks]
    trains = [train.at(levels) for train in problem.leave_out(masks)]
    equations = [
        train.with_grey(train.equations(problem.first_robust[~mask]), problem.grey, GREY_WEIGHTS)
        for train, mask in zip(trains, masks, strict=True)
    ]
    starts = [train.prior.values for train in trains]

    def held_out_error(smoothness: float) -> float:
        total = 0.0
        for fold, (train, test) in enumerate(zip(trains, tests, strict=True)):
            fit = train.solve(equations[fold], train.prior, smoothness, starts[fold], SEARCH_TOLERANCE)
            starts[fold] = fit.values
            error = test.squared_error(fit)
            total += float(np.sum(robust_weights(error) * error))
        return total

    return descend(held_out_error, DEFAULT_SMOOTHNESS, SMOOTHNESS_STEP, SMOOTHNESS_RANGE)
