"""Cholesky's factorization by blocks: against NumPy's solution, for any number of cores."""

import numpy as np
import pytest

from lutforge import threads
from lutforge.solvers.cholesky import BLOCK, solve_positive_definite


def matrix_of(size: int) -> np.ndarray:
    rows = np.random.default_rng(size).normal(size=(size, 40))
    return rows @ rows.T + np.eye(size)


@pytest.mark.parametrize("size", [1, 5, BLOCK, BLOCK + 1, 3 * BLOCK - 7])
def test_solution_is_numpys_whatever_lies_above_the_diagonal(size: int) -> None:
    matrix, right = matrix_of(size), np.random.default_rng(0).normal(size=(size, 3))
    lower = np.where(np.tri(size, dtype=bool), matrix, np.nan)
    np.testing.assert_allclose(solve_positive_definite(lower, right), np.linalg.solve(matrix, right), rtol=1e-8)


def test_cores_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    matrix, right = matrix_of(700), np.ones((700, 3))
    shared = solve_positive_definite(matrix.copy(), right)
    monkeypatch.setattr(threads, "_beside_others", lambda: True)
    np.testing.assert_array_equal(solve_positive_definite(matrix.copy(), right), shared)


@pytest.mark.parametrize("place", [(0, 0), (400, 3), (500, 500)])
@pytest.mark.parametrize("number", [np.nan, -1e6])
def test_other_matrices_are_refused(place: tuple[int, int], number: float) -> None:
    matrix = matrix_of(600)
    matrix[place] = number
    with pytest.raises(np.linalg.LinAlgError):
        solve_positive_definite(matrix, np.ones((600, 3)))
