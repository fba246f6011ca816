"""The iterative solution against the dense one, and what its terms promise."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, interpolate
from lutforge.model.lattice import grid, uniform_levels
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice
from lutforge.solvers.penalties import thin_plate
from lutforge.solvers.solution import Status
from tests.solvers.dense_lattice import (
    interpolation_weights,
    mixed_differences,
    random_levels,
    second_differences,
)

Array = NDArray[np.float64]
THESIS = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-6)


def boundary(size: tuple[int, int, int]) -> tuple[Array, Array]:
    """ρ of thesis 5.4 per output channel: the nodes that it holds (m, 3), and to what."""
    held, target = np.zeros((*size, 3)), np.zeros((*size, 3))
    for i, j, k in np.ndindex(*size):
        for c, (index, count) in enumerate(zip((i, j, k), size, strict=True)):
            if index == count - 1:
                held[i, j, k, c] = target[i, j, k, c] = 1.0
    held[0, 0, 0] = 1.0
    return held.reshape(-1, 3), target.reshape(-1, 3)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_the_thesis_objective_is_minimized(method: Interpolation) -> None:
    """(5.4) with all its terms, the closed form (5.5) per channel."""
    rng = np.random.default_rng(0)
    size = (7, 8, 6)
    levels = random_levels(rng, size)
    x, y = rng.random((400, 3)), rng.random((400, 3))
    terms = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-3)
    found = fit_lattice(x, y, levels, terms, method=method, tolerance=1e-12)

    weights, s = interpolation_weights(x, levels, method), second_differences(levels)
    count = int(np.prod(size))
    plate = thin_plate(size)(np.eye(count).reshape(count, *size)).reshape(count, count)
    held, target = boundary(size)
    for c in range(3):
        matrix = weights.T @ weights + 0.1 * s.T @ s + 1e-3 * plate + 0.01 * np.diag(held[:, c])
        wanted = np.linalg.solve(matrix, weights.T @ y[:, c] + 0.01 * target[:, c])
        np.testing.assert_allclose(found.value[..., c].ravel(), wanted, atol=1e-8)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_prior_weights_and_mixed_differences(method: Interpolation) -> None:
    rng = np.random.default_rng(1)
    size = (6, 7, 9)
    levels = random_levels(rng, size)
    x, y, omega = rng.random((250, 3)), rng.random((250, 3)), rng.random(250)
    prior = Prior(rng.random((*size, 3)), rng.random((*size, 3)) * (rng.random((*size, 3)) > 0.8))
    terms = Regularization(smoothness=0.02, mixed=0.03)
    found = fit_lattice(x, y, levels, terms, method=method, weight=omega, prior=prior, tolerance=1e-12)

    weights = interpolation_weights(x, levels, method)
    s, t = second_differences(levels), mixed_differences(size)
    smooth = 0.02 * s.T @ s + 0.03 * t.T @ t
    for c in range(3):
        hold, b0 = prior.weight[..., c].ravel(), prior.values[..., c].ravel()
        matrix = weights.T @ (omega[:, None] * weights) + smooth + np.diag(hold)
        wanted = np.linalg.solve(matrix, weights.T @ (omega * y[:, c]) + (smooth + np.diag(hold)) @ b0)
        np.testing.assert_allclose(found.value[..., c].ravel(), wanted, atol=1e-8)


def test_a_linear_function_is_found_exactly_and_continued() -> None:
    """Second differences vanish on it, so that samples in one corner say all of it."""
    rng = np.random.default_rng(2)
    levels = random_levels(rng, (17, 17, 17))
    matrix, offset = rng.normal(size=(3, 3)), rng.normal(size=3)
    x = rng.random((500, 3)) * 0.3
    terms = Regularization(smoothness=1e-3, mixed=1e-3)
    fit = fit_lattice(x, x @ matrix.T + offset, levels, terms, tolerance=1e-12)
    np.testing.assert_allclose(interpolate(x, levels, fit.value), x @ matrix.T + offset, atol=1e-7)
    np.testing.assert_allclose(fit.value, grid(levels) @ matrix.T + offset, atol=1e-3)


def test_without_samples_the_prior_is_the_result() -> None:
    values = np.random.default_rng(3).random((9, 9, 9, 3))
    prior = Prior(values, np.full_like(values, 1e-3))
    terms = Regularization(0.01, 0.01)
    fit = fit_lattice(np.empty((0, 3)), np.empty((0, 3)), uniform_levels(9), terms, prior=prior)
    np.testing.assert_allclose(fit.value, values, atol=1e-12)


def test_doubling_the_samples_is_doubling_their_weight() -> None:
    rng = np.random.default_rng(4)
    levels = random_levels(rng, (9, 9, 9))
    x, y = rng.random((300, 3)), rng.random((300, 3))
    twice = fit_lattice(np.tile(x, (2, 1)), np.tile(y, (2, 1)), levels, THESIS, tolerance=1e-12)
    heavy = fit_lattice(x, y, levels, THESIS, weight=np.full(300, 2.0), tolerance=1e-12)
    np.testing.assert_allclose(twice.value, heavy.value, atol=1e-9)


def test_a_warm_start_changes_the_time_only() -> None:
    rng = np.random.default_rng(5)
    levels = random_levels(rng, (13, 13, 13))
    x = rng.random((2000, 3))
    cold = fit_lattice(x, x**0.5, levels, THESIS, tolerance=1e-10)
    warm = fit_lattice(x, x**0.5, levels, THESIS, tolerance=1e-10, start=cold.value)
    assert warm.iterations <= 1 < cold.iterations
    np.testing.assert_allclose(warm.value, cold.value, atol=1e-8)


@pytest.mark.parametrize("size", [3, 4, 5, 6, 12, 24])
def test_every_size_converges(size: int) -> None:
    """Few samples and bunched levels, the hard case, held by a prior, as inverses are, or by none."""
    rng = np.random.default_rng(6)
    axis = np.linspace(0, 1, size) ** 3
    x, levels = rng.random((1500, 3)) ** 4, (axis, axis, axis)
    start = grid(levels)
    held = fit_lattice(x, x**0.45, levels, Regularization(1e-3, 1e-3), prior=Prior(start, np.full_like(start, 1e-5)))
    free = fit_lattice(x, x**0.45, levels, THESIS)
    for fit in (held, free):
        assert fit.converged and np.all(np.isfinite(fit.value))


def test_a_lattice_that_does_not_converge_is_said_so() -> None:
    rng = np.random.default_rng(7)
    x, levels = rng.random((300, 3)), uniform_levels(9)
    with pytest.raises(CalibrationError, match="1 iterations it reached its limit"):
        fit_lattice(x, x, levels, Regularization(0.1), prior=Prior(grid(levels) * 0, grid(levels) * 0 + 1e-6), most=1)
    near = fit_lattice(x, x, levels, THESIS, tolerance=1e-6, most=6)
    assert near.status is Status.LIMIT and near.residual > 1e-6
