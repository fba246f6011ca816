"""Interpolation between a lattice and a coarser one, and the operators that it makes, against dense matrices."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.interpolation import Levels
from lutforge.solvers.coarsening import (
    COARSEST,
    coarse_count,
    coarse_stencil,
    coarsen_axis,
    interpolation,
    prolong_add,
    restrict,
)
from lutforge.solvers.normal_equations import normal_equations
from lutforge.solvers.penalties import second_difference
from lutforge.solvers.stencil import from_planar, planar
from tests.solvers.dense_lattice import interpolation_weights, random_levels

Array = NDArray[np.float64]
SIZE, COARSE = (9, 6, 3), (5, 4, 3)


def matrix(levels: Array) -> tuple[Array, Array, NDArray[np.int64], NDArray[np.float32]]:
    """The coarse levels, P (N, N_coarse), and what it is made of: cells and shares."""
    coarse = np.empty(coarse_count(len(levels)))
    cell, share = np.empty(len(levels), dtype=np.int64), np.empty((2, len(levels)), dtype=np.float32)
    interpolation(levels, coarse, cell, share)
    dense = np.zeros((len(levels), len(coarse)))
    rows = np.arange(len(levels))
    dense[rows, cell] += share[0]
    dense[rows, cell + 1] += share[1]
    return coarse, dense, cell, share


def transfer(levels: Levels) -> tuple[Array, NDArray[np.int64], NDArray[np.float32]]:
    """P of a whole lattice (nodes, coarse nodes), cells and shares."""
    r, g, b = (matrix(axis) for axis in levels)
    cells, shares = np.zeros((3, 9), dtype=np.int64), np.zeros((3, 2, 9), dtype=np.float32)
    for axis, part in enumerate((r, g, b)):
        cells[axis, : len(part[2])], shares[axis, :, : len(part[2])] = part[2], part[3]
    return np.kron(np.kron(r[1], g[1]), b[1]), cells, shares


@pytest.mark.parametrize("count", [2, COARSEST, 6, 7, 33, 64])
def test_coarse_levels_are_levels_and_interpolate_linear_functions(count: int) -> None:
    levels = np.sort(np.random.default_rng(6).random(count))
    coarse, dense, _, share = matrix(levels)
    assert set(coarse) <= set(levels) and coarse[0] == levels[0] and coarse[-1] == levels[-1]
    assert len(coarse) == (count if count <= COARSEST else count // 2 + 1)
    assert share.min() >= 0.0 and share.max() <= 1.0
    np.testing.assert_allclose(dense @ (2 * coarse + 1), 2 * levels + 1, atol=1e-12)


def single(values: Array, *shape: int) -> NDArray[np.float32]:
    """Node values as the cycle takes them, (3, planes, N_g, N_b)."""
    return planar(values).reshape(3, *shape).astype(np.float32)


def test_there_and_back_are_transposed() -> None:
    rng = np.random.default_rng(0)
    dense, cells, shares = transfer(random_levels(rng, SIZE))
    fine, coarse = rng.normal(size=(*SIZE, 3)), rng.normal(size=(*COARSE, 3))
    padded, to = single(fine, 13, 6, 3), single(coarse, 9, 4, 3)
    prolong_add(to, cells, shares, padded, 0, 3)
    wanted = fine.reshape(-1, 3) + dense @ coarse.reshape(-1, 3)
    np.testing.assert_allclose(from_planar(padded, SIZE).reshape(-1, 3), wanted, atol=1e-5)
    restrict(single(fine, 13, 6, 3), cells, shares, to, 0, 3)
    np.testing.assert_allclose(from_planar(to, COARSE).reshape(-1, 3), dense.T @ fine.reshape(-1, 3), atol=1e-5)


def test_coarse_data_terms_are_the_projected_fine_ones() -> None:
    """P'AP, the Galerkin operator: as the samples make it on the coarse lattice, whose functions are fine ones too."""
    rng = np.random.default_rng(1)
    levels = random_levels(rng, SIZE)
    x = rng.random((300, 3))
    dense, cells, shares = transfer(levels)
    half = coarse_stencil(normal_equations(x, x, levels, "trilinear").stencil, cells, shares, *COARSE)
    weights = interpolation_weights(x, levels, "trilinear") @ dense
    found = np.zeros((60, 60))
    for node, (i, j, k) in enumerate(np.ndindex(COARSE)):
        for t in range(14):
            a, b, c = i + (t + 13) // 9 - 1, j + (t + 13) // 3 % 3 - 1, k + (t + 13) % 3 - 1
            if 0 <= a < 5 and 0 <= b < 4 and 0 <= c < 3:
                found[node, 12 * a + 3 * b + c] = half[t, i, j, k]
            else:
                assert half[t, i, j, k] == 0.0
    np.testing.assert_allclose(found, np.triu(weights.T @ weights), atol=1e-11)


def test_penalties_of_a_coarse_axis_are_the_projected_fine_ones() -> None:
    levels = random_levels(np.random.default_rng(2), (9, 2, 2))[0]
    _, dense, *_ = matrix(levels)
    cells, shares = np.zeros((2, 3, 9), dtype=np.int64), np.zeros((2, 3, 2, 9), dtype=np.float32)
    bends, slopes, masses = np.zeros((3, 3, 9, 3)), np.zeros((3, 3, 9, 3)), np.zeros((3, 3, 9))
    coarsen_axis(levels, 1, cells, shares, bends, slopes, masses)
    rows, first = second_difference(levels) @ dense, np.diff(np.eye(9), axis=0) @ dense
    bend, slope = rows.T @ rows, first.T @ first
    for offset in range(3):
        np.testing.assert_allclose(bends[1, 1, : 5 - offset, offset], np.diagonal(bend, offset), atol=1e-12)
    for offset in (-1, 0, 1):
        wanted = np.diagonal(slope, offset)
        np.testing.assert_allclose(slopes[1, 1, max(0, -offset) : 5 - max(0, offset), offset + 1], wanted, atol=1e-12)
    np.testing.assert_allclose(masses[1, 1, :5], dense.sum(axis=0), atol=1e-12)  # lumped
    assert masses[2, 1, :3].sum() == pytest.approx(9.0)
