"""The likely linear values given the JPEG's: what the inverse of a gamut map starts from, and chooses by.

The mean of likely scenes given a code is the least-squares function of the codes that the gamut map gives them: here a
lattice on the perceptual scale, whose values are differences, so that 0 is the inverse of matrix and response alone.
"""

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.model.gamut_map import GamutMap, to_even
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import uniform_levels
from lutforge.model.response import Response
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice

SIZE = 25
"""Nodes per axis."""
SMOOTH_LATTICE = Regularization(smoothness=0.01, mixed=0.01)
"""Weights of second differences beside a scene's weight of 1: the lattice continues where no scene is."""
HOLD = 0.01
"""Weight of matrix and response alone at a node."""


def fit_inverse(
    forward: GamutMap, matrix: Array, response: Response, linear: Array, mapped: Array, weight: Array, whole: Mask
) -> SolvedInverse:
    """The inverse of a gamut map, by likely scenes.

    matrix: Ts (3, 3); linear, mapped: X and h(X) of the scenes (m, 3), X = Ts Tw E; weight, whole: (m,), their weights,
    and which of them no channel clips.
    """
    top = float(max(to_even(response.inverse[-1], forward.offset).max(), 1e-3))
    even = np.clip(to_even(mapped[whole], forward.offset), 0.0, top)
    correction = to_even(linear[whole], forward.offset) - even
    shape = (SIZE, SIZE, SIZE, 3)
    fitted = fit_lattice(
        even / top,
        correction,
        uniform_levels(SIZE),
        SMOOTH_LATTICE,
        weight=weight[whole] / weight[whole].mean(),
        prior=Prior(np.zeros(shape), np.full(shape, HOLD)),
        tolerance=1e-3,
    )
    return SolvedInverse(forward, matrix, fitted.value, top)
