"""Lattice regression: the iterative solution against the dense one, written out with one matrix for each term."""

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, interpolate
from lutforge.model.lattice import grid, uniform_levels
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice
from lutforge.solvers.normal_equations import normal_equations
from lutforge.solvers.penalties import thin_plate
from lutforge.solvers.solution import Status

THESIS = Regularization(smoothness=0.1, anchor=0.01, thin_plate=1e-6)


def random_levels(rng: np.random.Generator, size: tuple[int, int, int]) -> Levels:
    """Strictly increasing levels from 0 to 1, far from even."""
    r, g, b = (np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 2.0, count - 1))]) for count in size)
    return (r / r[-1], g / g[-1], b / b[-1])


def interpolation_weights(x: Array, levels: Levels, method: Interpolation) -> Array:
    """W (n, m): the response of the interpolation to each unit lattice."""
    shape = tuple(len(axis) for axis in levels)
    units = np.eye(int(np.prod(shape))).reshape(*shape, -1)
    return interpolate(x, levels, units, method)


def along(matrix: Array, shape: tuple[int, ...], axis: int) -> Array:
    """The (…, m) matrix that applies `matrix` along one axis of a lattice of that shape."""
    factors = [np.eye(count) for count in shape]
    factors[axis] = matrix
    return np.asarray(np.kron(np.kron(factors[0], factors[1]), factors[2]))


def second_differences(levels: Levels) -> Array:
    """S, row by row from the definition of thesis 5.4."""
    shape = tuple(len(axis) for axis in levels)
    parts = []
    for axis, nodes in enumerate(levels):
        rows = np.zeros((len(nodes) - 2, len(nodes)))
        for i in range(1, len(nodes) - 1):
            before, after = nodes[i] - nodes[i - 1], nodes[i + 1] - nodes[i]
            rows[i - 1, i - 1 : i + 2] = -after / (before + after), 1.0, -before / (before + after)
        parts.append(along(rows, shape, axis))
    return np.concatenate(parts)


def mixed_differences(shape: tuple[int, int, int]) -> Array:
    """T: the difference of differences over each square of neighbours, for each pair of axes."""
    first = [along(np.diff(np.eye(count), axis=0), shape, axis) for axis, count in enumerate(shape)]
    parts = []
    for one, two in ((0, 1), (0, 2), (1, 2)):
        narrow = list(shape)
        narrow[two] -= 1
        inner = first[two]
        outer = along(np.diff(np.eye(shape[one]), axis=0), tuple(narrow), one)
        parts.append(outer @ inner)
    return np.concatenate(parts)


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
        expected = np.linalg.solve(matrix, weights.T @ y[:, c] + 0.01 * target[:, c])
        np.testing.assert_allclose(found.value[..., c].ravel(), expected, atol=1e-8)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_prior_weights_and_mixed_differences(method: Interpolation) -> None:
    rng = np.random.default_rng(1)
    size = (6, 7, 9)
    levels = random_levels(rng, size)
    x, y, omega = rng.uniform(-0.1, 1.1, (250, 3)), rng.random((250, 3)), rng.random(250)
    x[:8] = np.array([[i, j, k] for i in (0, 1) for j in (0, 1) for k in (0, 1)])  # the corners themselves
    x[8:20] = np.stack([axis[rng.integers(0, len(axis), 12)] for axis in levels], axis=1)  # and nodes
    prior = Prior(rng.random((*size, 3)), rng.random((*size, 3)) * (rng.random((*size, 3)) > 0.8))
    terms = Regularization(smoothness=0.02, mixed=0.03)
    found = fit_lattice(x, y, levels, terms, method=method, weight=omega, prior=prior, tolerance=1e-12)

    weights = interpolation_weights(x, levels, method)
    s, t = second_differences(levels), mixed_differences(size)
    smooth = 0.02 * s.T @ s + 0.03 * t.T @ t
    for c in range(3):
        hold, b0 = prior.weight[..., c].ravel(), prior.values[..., c].ravel()
        matrix = weights.T @ (omega[:, None] * weights) + smooth + np.diag(hold)
        expected = np.linalg.solve(matrix, weights.T @ (omega * y[:, c]) + (smooth + np.diag(hold)) @ b0)
        np.testing.assert_allclose(found.value[..., c].ravel(), expected, atol=1e-8)


def test_without_samples_the_prior_is_the_result() -> None:
    values = np.random.default_rng(3).random((9, 9, 9, 3))
    prior = Prior(values, np.full_like(values, 1e-3))
    terms = Regularization(0.01, 0.01)
    fit = fit_lattice(np.empty((0, 3)), np.empty((0, 3)), uniform_levels(9), terms, prior=prior)
    np.testing.assert_allclose(fit.value, values, atol=1e-12)


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
    with pytest.raises(CalibrationError, match=Status.SINGULAR.value):
        fit_lattice(x, np.full_like(x, np.nan), levels, THESIS)
    near = fit_lattice(x, x, levels, THESIS, tolerance=1e-6, most=6)
    assert near.status is Status.LIMIT and near.residual > 1e-6


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_many_samples_are_summed_as_a_few_are(method: Interpolation) -> None:
    """The threaded assembly of a large sample set, sample by sample in one's own words."""
    rng = np.random.default_rng(4)
    levels = random_levels(rng, (7, 6, 5))
    x, y = rng.random((200_000, 3)) ** 3, rng.random((200_000, 3))
    whole = normal_equations(x, y, levels, method)
    parts = [
        normal_equations(x[start : start + 999], y[start : start + 999], levels, method)
        for start in range(0, len(x), 999)
    ]
    summed = sum(part.matrix.toarray() for part in parts)
    np.testing.assert_allclose(whole.matrix.toarray(), summed, rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose(whole.right, sum(part.right for part in parts), rtol=1e-11, atol=1e-9)
    assert whole.matrix.sum() == pytest.approx(len(x))  # the weights of a sample sum to 1


def test_the_thin_plate_alone_is_minimized() -> None:
    """(5.3) has no smoothness term: most nodes of a lattice of few samples are only in the thin plate's."""
    rng = np.random.default_rng(0)
    size, count = (7, 6, 5), 210
    levels = random_levels(rng, size)
    x, y = rng.random((60, 3)), rng.random((60, 3))
    terms = Regularization(thin_plate=1e-4)
    found = fit_lattice(x, y, levels, terms, tolerance=1e-11)
    weights = interpolation_weights(x, levels, "trilinear")
    plate = thin_plate(size)(np.eye(count).reshape(count, *size)).reshape(count, count)
    expected = np.linalg.solve(weights.T @ weights + 1e-4 * plate, weights.T @ y)
    np.testing.assert_allclose(found.value.reshape(count, 3), expected, atol=1e-5)
