"""Least squares with inequality constraints, against scipy's bounded solver and by hand."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lutforge.errors import CalibrationError
from lutforge.solvers.inequality_least_squares import solve_lsi


@pytest.mark.parametrize("seed", range(8))
def test_bounds_agree_with_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    design, target = rng.normal(size=(40, 6)), rng.normal(size=40)
    low = rng.uniform(-0.3, 0.3, 6)
    expected = lsq_linear(design, target, bounds=(low, np.inf), tol=1e-14).x
    np.testing.assert_allclose(solve_lsi(design.T @ design, design.T @ target, np.eye(6), low), expected, atol=1e-7)


def test_isotonic_regression() -> None:
    # Pool-adjacent-violators by hand: 1, 3, 2, 4 → 1, 2.5, 2.5, 4.
    rising = np.diff(np.eye(4), axis=0)
    solution = solve_lsi(np.eye(4), np.array([1.0, 3.0, 2.0, 4.0]), rising, np.zeros(3))
    np.testing.assert_allclose(solution, [1.0, 2.5, 2.5, 4.0], atol=1e-9)
    nearest = solve_lsi(np.eye(2), np.zeros(2), np.array([[1.0, 1.0]]), np.array([2.0]))
    np.testing.assert_allclose(nearest, [1.0, 1.0])


def test_impossible_and_undetermined_problems_are_refused() -> None:
    with pytest.raises(CalibrationError, match="contradict"):
        solve_lsi(np.eye(2), np.zeros(2), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0]))
    with pytest.raises(CalibrationError, match="too few tones"):
        solve_lsi(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), np.eye(2), np.zeros(2))
