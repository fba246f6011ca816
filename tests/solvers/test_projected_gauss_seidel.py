"""Lattice regression with nodes in bounds: the free solution where they do not bind, else better than clipping it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.interpolation import Levels, interpolate
from lutforge.model.lattice import grid
from lutforge.solvers.lattice_regression import Prior, Regularization, solve_lattice
from lutforge.solvers.normal_equations import NormalEquations, normal_equations
from lutforge.solvers.projected_gauss_seidel import solve_bounded
from lutforge.solvers.solution import Status

Array = NDArray[np.float64]
SMOOTHNESS = 0.05


def problem(size: tuple[int, int, int]) -> tuple[NormalEquations, Levels, Prior]:
    """Samples of a function that leaves [0, 1], at uneven node levels, and a prior."""
    rng = np.random.default_rng(0)
    x = rng.random((2000, 3))
    y = 1.6 * x**2 - 0.3 + 0.01 * rng.normal(size=x.shape)
    r, g, b = (np.concatenate([[0.0], np.sort(rng.random(count - 2)), [1.0]]) for count in size)
    prior = Prior(0.5 * grid((r, g, b)) + 0.2, np.full((*size, 3), 1e-2))
    return normal_equations(x, y - interpolate(x, (r, g, b), prior.values), (r, g, b), "trilinear"), (r, g, b), prior


def free(equations: NormalEquations, levels: Levels, prior: Prior) -> Array:
    regularization = Regularization(SMOOTHNESS, mixed=SMOOTHNESS, anchor=0.0, thin_plate=0.0)
    return solve_lattice(equations, levels, regularization, prior=prior, tolerance=1e-10).values


@pytest.mark.parametrize("size", [(2, 3, 4), (7, 5, 6)])
def test_bounds_that_do_not_bind_change_nothing(size: tuple[int, int, int]) -> None:
    equations, levels, prior = problem(size)
    bounded = solve_bounded(equations, levels, SMOOTHNESS, prior, prior.values, (-9.0, 9.0), 2000)
    assert bounded.status is Status.CONVERGED and bounded.residual < 1e-9
    np.testing.assert_allclose(bounded.values, free(equations, levels, prior), atol=1e-7)


def test_bounded_least_squares() -> None:
    """The same from any start, and nearer to a function that is cut off than the free nodes cut off."""
    equations, levels, prior = problem((5, 6, 5))
    bounded = solve_bounded(equations, levels, SMOOTHNESS, prior, prior.values, (0.0, 1.0), 2000).values
    assert bounded.min() == 0.0 and bounded.max() == 1.0
    best = free(equations, levels, prior)
    assert best.min() < -0.1 and best.max() > 1.1
    other = solve_bounded(equations, levels, SMOOTHNESS, prior, best, (0.0, 1.0), 2000).values
    np.testing.assert_allclose(other, bounded, atol=1e-9)  # one minimum, whatever the start
    clipped = np.clip(best, 0.0, 1.0)
    rng = np.random.default_rng(1)
    x = rng.random((5000, 3))
    wanted = np.clip(1.6 * x**2 - 0.3, 0.0, 1.0)
    errors = [np.mean((interpolate(x, levels, values) - wanted) ** 2) for values in (bounded, clipped)]
    assert errors[0] < errors[1]


def test_sweeps_that_do_not_suffice_are_said_so() -> None:
    equations, levels, prior = problem((7, 5, 6))
    cut_short = solve_bounded(equations, levels, SMOOTHNESS, prior, prior.values, (0.0, 1.0), 2)
    assert cut_short.status is Status.LIMIT and cut_short.residual > 1e-3 and cut_short.iterations == 2
