"""Damped Gauss–Newton steps, for many problems at once, against known minima."""

import numpy as np

from lutforge.arrays import Array
from lutforge.solvers.gauss_newton import Index, gauss_newton
from lutforge.solvers.solution import Status


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
    expected, t = rng.uniform(0.5, 2.0, (200, 2)), np.linspace(0, 1, 9)
    curves = expected[:, :1] * np.exp(expected[:, 1:] * t)
    seen = []

    def linearize(x: Array, which: Index) -> tuple[Array, Array]:
        seen.append(len(which))
        shape = np.exp(x[:, 1:] * t)
        return x[:, :1] * shape - curves[which], np.stack([shape, x[:, :1] * shape * t], axis=2)

    start = np.where(np.arange(200)[:, None] < 50, expected, 1.0)
    minima = gauss_newton(linearize, start)
    np.testing.assert_allclose(minima.value, expected, atol=1e-5)
    assert minima.converged.all() and min(seen) < 150


def test_a_search_that_is_cut_short_is_said_so() -> None:
    minima = gauss_newton(rosenbrock, np.array([[-1.2, 1.0], [1.0, 1.0]]), most=2)
    assert minima.status is Status.LIMIT and minima.iterations == 2
    np.testing.assert_array_equal(minima.converged, [False, True])
