"""Conjugate gradients on dense systems: the solution, and how it is said that there is none."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.solvers.lattice_regression import conjugate_gradients
from lutforge.solvers.solution import Solution, Status

Array = NDArray[np.float64]
RNG = np.random.default_rng(0)
FACTOR, RIGHT = RNG.normal(size=(40, 40)), RNG.normal(size=(3, 40))
MATRIX = FACTOR @ FACTOR.T + np.diag(RNG.uniform(1, 100, 40))


def solve(matrix: Array, start: Array, tolerance: float = 1e-12, most: int = 200) -> Solution:
    """By its diagonal as the preconditioner."""
    return conjugate_gradients(
        lambda b: np.asarray(b @ matrix), lambda r: r / np.diag(matrix), RIGHT, start, tolerance=tolerance, most=most
    )


@pytest.mark.parametrize("warm", [False, True])
def test_solves_every_system(warm: bool) -> None:
    wanted = np.asarray(np.linalg.solve(MATRIX, RIGHT.T).T)
    solution = solve(MATRIX, wanted + 1e-3 if warm else np.zeros_like(wanted))
    assert solution.converged and solution.residual <= 1e-12
    np.testing.assert_allclose(solution.value, wanted, atol=1e-10)
    assert solve(MATRIX, wanted, 1e-9).iterations == 0


def test_the_limit_is_a_status_and_nan_is_another() -> None:
    solution = solve(MATRIX, np.zeros((3, 40)), most=3)
    assert solution.status is Status.LIMIT and solution.iterations == 3 and solution.residual > 1e-12
    assert solve(np.full((40, 40), np.nan), np.zeros((3, 40))).status is Status.SINGULAR
