"""The smoothness λ_S of a lattice, chosen on shots that were left out."""

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.lattice.problem import LatticeProblem
from lutforge.calibration.lattice.weights import outlier_weights
from lutforge.calibration.lattice_options import SEARCH_SIZE
from lutforge.interpolation import Levels
from lutforge.solvers.cross_validation import descend, leave_groups_out


def choose_smoothness(problem: LatticeProblem, groups: NDArray[np.str_], levels: Levels) -> float:
    """Return the λ_S of least error on held-out shots; that of the options where no shot can be held out.

    groups: (n,), the shot of each sample. The search walks in steps of √10: the error is flat near its minimum. Two
    folds choose the same λ_S as five do; of a lattice smaller than SEARCH_SIZE one of them does, in half the time.
    """
    options = problem.options.lattice
    masks = [mask for mask in leave_groups_out(groups, 2) if 0 < mask.sum() < len(mask)]
    masks = masks[: 1 if problem.options.size < SEARCH_SIZE else 2]
    if not masks:
        return options.smoothness
    tests = [problem.select(mask, problem.guess).at(levels) for mask in masks]
    trains = [train.at(levels) for train in problem.leave_out(masks)]
    equations = [
        train.with_grey(train.equations(problem.first_robust[~mask]), problem.grey)
        for train, mask in zip(trains, masks, strict=True)
    ]
    starts = [train.prior.values for train in trains]

    def held_out_error(smoothness: float) -> float:
        total = 0.0
        for fold, (train, test) in enumerate(zip(trains, tests, strict=True)):
            fit = train.solve(equations[fold], train.prior, smoothness, starts[fold], options.search_tolerance)
            starts[fold] = fit.values
            error = test.squared_error(fit)
            total += float(np.sum(outlier_weights(error, options) * error))
        return total

    return descend(held_out_error, options.smoothness, 10**0.5, (1e-4, 10.0))
