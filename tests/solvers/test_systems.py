"""Solvers of systems, searches of minima, folds and robust weights: against NumPy, scipy, and what is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from lutforge import threads
from lutforge.errors import CalibrationError
from lutforge.solvers.cholesky import BLOCK, solve_positive_definite
from lutforge.solvers.cross_validation import leave_groups_out, leave_samples_out, predict_held_out
from lutforge.solvers.gauss_newton import Index, gauss_newton
from lutforge.solvers.inequality_least_squares import least_distance, solve_lsi
from lutforge.solvers.robust_weights import Loss, RobustWeights, cauchy, geman_mcclure, lawson, weighted_median
from lutforge.solvers.solution import Status


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


# --- Damped Gauss-Newton against minima that are known, many problems at once -----------------------------------------


Array = NDArray[np.float64]


def rosenbrock(x: Array, which: Index) -> tuple[Array, Array]:
    """Residuals (10 (x₂ − x₁²), 1 − x₁), whose minimum 0 lies at (1, 1), at the end of a bent valley."""
    residual = np.stack([10 * (x[:, 1] - x[:, 0] ** 2), 1 - x[:, 0]], axis=1)
    slope = np.zeros((len(x), 2, 2))
    slope[:, 0, 0], slope[:, 0, 1], slope[:, 1, 0] = -20 * x[:, 0], 10.0, -1.0
    return residual, slope


def test_every_problem_reaches_its_minimum() -> None:
    start = np.random.default_rng(0).uniform(-2, 2, (300, 2))
    minima = gauss_newton(rosenbrock, start, most=200)
    assert minima.converged.all() and minima.status is Status.CONVERGED
    np.testing.assert_allclose(minima.value, 1.0, atol=1e-5)


def test_bounds_hold_and_the_rest_is_minimal_there() -> None:
    start = np.random.default_rng(1).uniform(-2, 2, (50, 2))
    minima = gauss_newton(rosenbrock, start, lower=(-2.0, -2.0), upper=(0.5, 2.0), most=200)
    assert minima.converged.all()
    np.testing.assert_allclose(minima.value, [[0.5, 0.25]] * 50, atol=1e-6)
    np.testing.assert_allclose(minima.residual, 0.5, atol=1e-6)


def test_problems_have_data_of_their_own_and_unequal_lengths_of_search() -> None:
    """Fits of a · exp(b t) to curves, some of them started at the solution."""
    rng = np.random.default_rng(2)
    wanted, t = rng.uniform(0.5, 2.0, (200, 2)), np.linspace(0, 1, 9)
    curves = wanted[:, :1] * np.exp(wanted[:, 1:] * t)
    seen = []

    def linearize(x: Array, which: Index) -> tuple[Array, Array]:
        seen.append(len(which))
        shape = np.exp(x[:, 1:] * t)
        return x[:, :1] * shape - curves[which], np.stack([shape, x[:, :1] * shape * t], axis=2)

    start = np.where(np.arange(200)[:, None] < 50, wanted, 1.0)
    minima = gauss_newton(linearize, start)
    np.testing.assert_allclose(minima.value, wanted, atol=1e-5)
    assert minima.converged.all() and min(seen) < 150


def test_a_search_that_is_cut_short_is_said_so() -> None:
    minima = gauss_newton(rosenbrock, np.array([[-1.2, 1.0], [1.0, 1.0]]), most=2)
    assert minima.status is Status.LIMIT and minima.iterations == 2
    np.testing.assert_array_equal(minima.converged, [False, True])


# --- LSI against scipy's bounded solver and by hand -------------------------------------------------------------------


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


def test_impossible_and_undetermined_problems_are_refused() -> None:
    with pytest.raises(CalibrationError, match="contradict"):
        solve_lsi(np.eye(2), np.zeros(2), np.array([[1.0, 0.0], [-1.0, 0.0]]), np.array([1.0, 1.0]))
    with pytest.raises(CalibrationError, match="too few tones"):
        solve_lsi(np.array([[1.0, 2.0], [2.0, 1.0]]), np.ones(2), np.eye(2), np.zeros(2))


def test_a_least_distance_that_there_is_not_is_said_so() -> None:
    assert least_distance(np.array([[1.0], [-1.0]]), np.array([1.0, 1.0])).status is Status.INFEASIBLE
    nearest = least_distance(np.array([[1.0, 1.0]]), np.array([2.0]))
    assert nearest.converged and nearest.residual == pytest.approx(2**0.5)
    np.testing.assert_allclose(nearest.value, [1.0, 1.0])


# --- Folds hold out whole shots, each once ----------------------------------------------------------------------------


def test_folds_leave_whole_shots_out_once() -> None:
    groups = np.array(["a"] * 5 + ["b"] * 3 + ["c"] * 9 + ["d"] + ["e"] * 2 + ["f"] * 2)
    masks = leave_groups_out(groups, 4)
    assert len(masks) == 4
    np.testing.assert_array_equal(np.sum(masks, axis=0), 1)
    for mask in masks:
        assert not set(groups[mask]) & set(groups[~mask])
    assert len(leave_groups_out(np.array(["a", "a"]))) == 1


def test_samples_without_groups_are_left_out_once() -> None:
    np.testing.assert_array_equal(np.sum(leave_samples_out(13, 5), axis=0), 1)


def test_a_held_out_prediction_is_of_the_other_samples() -> None:
    values = np.arange(12.0)
    means = predict_held_out(leave_samples_out(12, 3), lambda train, test: np.full(test.sum(), values[train].mean()))
    for fold in range(3):
        np.testing.assert_allclose(means[fold::3], np.delete(values.reshape(4, 3), fold, axis=1).mean())


# --- Weights of robust fits: their values where the definitions say so, and fits that outliers do not bend ------------


def test_weights_at_the_scale() -> None:
    ratio = np.array([0.0, 1.0, 1e6])
    np.testing.assert_allclose(cauchy(ratio), [1.0, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(geman_mcclure(ratio), [1.0, 0.25, 0.0], atol=1e-9)


@pytest.mark.parametrize("loss", [cauchy, geman_mcclure])
def test_reweighted_mean_ignores_outliers(loss: Loss) -> None:
    rng = np.random.default_rng(0)
    values = np.concatenate([rng.normal(2.0, 0.01, 80), rng.normal(9.0, 0.01, 20)])
    robust, mean = RobustWeights(loss, multiple=3.0, least=1e-3), float(np.median(values))
    for _ in range(20):
        mean = float(np.average(values, weights=robust(np.abs(values - mean))))
    assert abs(values.mean() - 2.0) > 1.0 > 100 * abs(mean - 2.0)


def test_scale_is_of_the_samples_that_tell_it_and_not_below_the_least() -> None:
    robust = RobustWeights(cauchy, multiple=2.0, least=0.5)
    assert robust.scale(np.array([1.0, 1.0, 9.0])) == 2.0
    assert robust.scale(np.zeros(5)) == 0.5
    np.testing.assert_allclose(robust(np.array([2.0, 4.0]), like=np.ones(3)), [0.5, 0.2])
    assert robust.scale(np.array([1.0, 5.0]), weight=np.array([1.0, 3.0])) == 10.0


def test_weighted_median_holds_half_of_the_weight() -> None:
    assert weighted_median(np.array([3.0, 1.0, 2.0]), np.array([1.0, 1.0, 5.0])) == 2.0


def test_lawson_weights_bring_the_largest_error_down() -> None:
    """The best constant in the maximum norm is the middle of the range, that of least squares the mean."""
    values = np.concatenate([np.zeros(90), np.full(10, 1.0)])
    weight, constant = np.ones(100), 0.0
    for _ in range(50):
        constant = float(np.average(values, weights=weight))
        weight = weight * lawson(np.abs(values - constant), 1.0, least=0.0)
    assert values.mean() == 0.1 and abs(constant - 0.5) < 1e-3
