"""The multigrid operator and its cycle, as the conjugate gradients need them: linear, symmetric, positive."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels
from lutforge.solvers import multigrid as module
from lutforge.solvers.conjugate_gradients import conjugate_gradients
from lutforge.solvers.multigrid import Multigrid
from lutforge.solvers.normal_equations import normal_equations
from lutforge.solvers.solution import Solution
from lutforge.solvers.stencil import from_planar, planar
from tests.solvers.dense_lattice import interpolation_weights, mixed_differences, random_levels, second_differences

Array = NDArray[np.float64]

SIZE = (9, 6, 7)


def samples(size: tuple[int, int, int]) -> tuple[Levels, Array, Array]:
    """Random node levels, sample positions (300, 3) and an anchor."""
    rng = np.random.default_rng(0)
    levels = random_levels(rng, size)
    return levels, rng.random((300, 3)), rng.random((*size, 3)) * 0.01


def hierarchy(method: Interpolation = "trilinear", size: tuple[int, int, int] = SIZE, **threads: int) -> Multigrid:
    """Over random samples."""
    levels, x, anchor = samples(size)
    return Multigrid(levels, normal_equations(x, x, levels, method).stencil, anchor, 0.02, 0.03, **threads)


def make(method: Interpolation = "trilinear", size: tuple[int, int, int] = SIZE) -> tuple[Multigrid, Array]:
    """A hierarchy, and the dense matrix (3, m, m) of its finest operator."""
    levels, x, anchor = samples(size)
    weights, s, t = interpolation_weights(x, levels, method), second_differences(levels), mixed_differences(size)
    dense = weights.T @ weights + 0.02 * s.T @ s + 0.03 * t.T @ t
    return hierarchy(method, size), np.stack([dense + np.diag(anchor[..., c].ravel()) for c in range(3)])


def product(multigrid: Multigrid, b: Array) -> Array:
    image = np.empty_like(planar(b))
    multigrid.product(planar(b), image)
    return from_planar(image, multigrid.size)


def cycle(multigrid: Multigrid, right: Array) -> Array:
    return from_planar(multigrid.precondition(planar(right)), multigrid.size)


def solve(multigrid: Multigrid, right: Array) -> tuple[Array, Solution]:
    solution = conjugate_gradients(multigrid, planar(right), tolerance=1e-12)
    return from_planar(solution.value, multigrid.size), solution


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_operator_equals_the_dense_matrix(method: Interpolation) -> None:
    multigrid, matrices = make(method)
    b = np.random.default_rng(1).normal(size=(*SIZE, 3))
    wanted = np.einsum("cmn,nc->mc", matrices, b.reshape(-1, 3)).reshape(b.shape)
    np.testing.assert_allclose(product(multigrid, b), wanted, atol=1e-12)


@pytest.mark.parametrize("size", [(9, 6, 7), (2, 5, 4), (3, 3, 3)])
def test_cycle_is_symmetric_and_positive_and_no_eigenvalue_is_above_two(size: tuple[int, int, int]) -> None:
    """Below two, the cycle alone would converge: the smoother's bound on the spectrum holds on every lattice."""
    multigrid, matrices = make(size=size)
    count = int(np.prod(size))
    for c in range(3):
        inverse = np.empty((count, count))
        for column in range(count):
            unit = np.zeros((count, 3))
            unit[column, c] = 1.0
            inverse[:, column] = cycle(multigrid, unit.reshape(*size, 3))[..., c].ravel()
        np.testing.assert_allclose(inverse, inverse.T, atol=1e-6 * np.abs(inverse).max())  # float32
        values = np.linalg.eigvals(inverse @ matrices[c]).real
        assert values.min() > 0.2 and values.max() < 1.2


def test_solves_what_the_dense_matrix_solves() -> None:
    multigrid, matrices = make()
    right = np.random.default_rng(4).normal(size=(*SIZE, 3))
    found, solution = solve(multigrid, right)
    wanted = np.stack([np.linalg.solve(matrices[c], right[..., c].ravel()) for c in range(3)], axis=1)
    np.testing.assert_allclose(found.reshape(-1, 3), wanted, atol=1e-8)
    assert solution.converged and solution.iterations < 30


def test_threads_do_not_change_a_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    size = (17, 12, 14)
    right = np.random.default_rng(6).normal(size=(*size, 3))
    in_one_call = solve(hierarchy(size=size), right)[0]
    found = []
    for cores in (1, 2, 3):
        monkeypatch.setattr(module, "cores", lambda cores=cores: cores)
        found.append(solve(hierarchy(size=size, small=500, nodes_per_thread=100), right)[0])
        np.testing.assert_array_equal(found[-1], found[0])
    np.testing.assert_allclose(found[0], in_one_call, atol=1e-8)
