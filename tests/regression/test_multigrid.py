"""The multigrid operator and its cycle, as the conjugate gradients need them: linear, symmetric, positive."""

import numpy as np
import pytest
from dense_lattice import interpolation_weights, mixed_differences, random_levels, second_differences

from lutforge.errors import CalibrationError
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.regression.lattice_regression import Regularisation, hierarchy
from lutforge.regression.multigrid import COARSEST, Multigrid, coarse_nodes, interpolation_matrix, to_bands
from lutforge.regression.normal_equations import normal_equations

SIZE = (9, 6, 7)


def make(method: Interpolation = "trilinear", samples: int = 300) -> tuple[Multigrid, np.ndarray]:
    """A multigrid hierarchy over random samples, and the dense matrix (3, m, m) of its finest operator."""
    rng = np.random.default_rng(0)
    levels = random_levels(rng, SIZE)
    x = rng.random((samples, 3))
    anchor = rng.random((*SIZE, 3)) * 0.01
    terms = Regularisation(0.02, 0.03, 0.0, 0.0)
    weights, s, t = interpolation_weights(x, levels, method), second_differences(levels), mixed_differences(SIZE)
    dense = weights.T @ weights + 0.02 * s.T @ s + 0.03 * t.T @ t
    matrices = np.stack([dense + np.diag(anchor[..., c].ravel()) for c in range(3)])
    stencil = normal_equations(x, x, levels, method).stencil
    return hierarchy(levels, stencil, anchor, terms), matrices


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_operator_equals_the_dense_matrix(method: Interpolation) -> None:
    multigrid, matrices = make(method)
    b = np.random.default_rng(1).normal(size=(*SIZE, 3))
    wanted = np.einsum("cmn,nc->mc", matrices, b.reshape(-1, 3)).reshape(b.shape)
    np.testing.assert_allclose(multigrid.apply(b), wanted, atol=1e-12)


@pytest.mark.parametrize("smoothness", [0.0, 0.02])
def test_coarse_operators_are_the_projected_fine_ones(smoothness: float) -> None:
    """P'AP, the Galerkin operator; the second differences and the diagonal are at least as stiff as that."""
    rng = np.random.default_rng(2)
    levels = random_levels(rng, SIZE)
    x = rng.random((300, 3))
    stencil = normal_equations(x, x, levels, "trilinear").stencil
    multigrid = hierarchy(levels, stencil, np.full((*SIZE, 3), smoothness), Regularisation(smoothness, 0.03, 0, 0))
    assert len(multigrid.levels) == 3
    transfer = multigrid.transfers[0]
    parts = []
    for count, cells, fractions in zip(SIZE, transfer.cells, transfer.fractions, strict=True):
        matrix = np.zeros((count, len(coarse_nodes(count))))
        matrix[np.arange(count), cells] = 1 - fractions
        matrix[np.arange(count), cells + 1] += fractions
        parts.append(matrix)
    for _ in range(5):
        b = rng.normal(size=multigrid.levels[1].anchor.shape)
        fine = np.einsum("ia,jb,kc,abcd->ijkd", *parts, b)
        energy, projected = np.sum(fine * multigrid.apply(fine)), np.sum(b * multigrid.apply(b, 1))
        if smoothness:
            assert energy < projected < 5 * energy
        else:
            assert projected == pytest.approx(energy, rel=1e-12)


def test_cycle_is_symmetric_and_positive() -> None:
    multigrid, _ = make()
    rng = np.random.default_rng(3)
    for _ in range(5):
        u, v = rng.normal(size=(2, *SIZE, 3))
        for c in range(3):
            left = np.sum(multigrid.cycle(u)[..., c] * v[..., c])
            assert left == pytest.approx(np.sum(u[..., c] * multigrid.cycle(v)[..., c]), rel=1e-9, abs=1e-9)
        assert np.sum(u * multigrid.cycle(u)) > 0


def test_solves_what_the_dense_matrix_solves() -> None:
    multigrid, matrices = make()
    right = np.random.default_rng(4).normal(size=(*SIZE, 3))
    found, iterations = multigrid.solve(right, np.zeros_like(right), 1e-12)
    wanted = np.stack([np.linalg.solve(matrices[c], right[..., c].ravel()) for c in range(3)], axis=1)
    np.testing.assert_allclose(found.reshape(-1, 3), wanted, atol=1e-8)
    assert iterations < 30


def test_a_system_that_cannot_be_solved_is_said_so() -> None:
    multigrid, _ = make()
    right = np.random.default_rng(5).normal(size=(*SIZE, 3))
    with pytest.raises(CalibrationError, match="1 iterations left a residual"):
        multigrid.solve(right, np.zeros_like(right), 1e-14, most=1)


@pytest.mark.parametrize("count", [2, COARSEST, 6, 7, 33, 64])
def test_coarse_nodes_nest_and_interpolate_linear_functions(count: int) -> None:
    levels = np.sort(np.random.default_rng(6).random(count))
    kept = coarse_nodes(count)
    assert kept[0] == 0 and kept[-1] == count - 1 and (count <= COARSEST or len(kept) == count // 2 + 1)
    _, _, matrix = interpolation_matrix(levels, kept)
    np.testing.assert_allclose(matrix @ (2 * levels[kept] + 1), 2 * levels + 1, atol=1e-12)


def test_bands() -> None:
    matrix = np.add.outer(10 * np.arange(4.0), np.arange(4.0))
    np.testing.assert_array_equal(to_bands(matrix)[1], [0, 10, 11, 12, 13])
    np.testing.assert_array_equal(to_bands(matrix)[3], [31, 32, 33, 0, 0])
