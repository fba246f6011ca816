"""The nonuniform lattice: interpolation against known functions, and what it refuses."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels
from lutforge.model.lattice import Lattice, grid, uniform_levels

RNG = np.random.default_rng(1)
LEVELS = [0.0, 0.5, 1.0]


def _levels(rng: np.random.Generator, sizes: tuple[int, int, int] = (5, 7, 6)) -> Levels:
    r, g, b = (np.concatenate([[0.0], np.sort(rng.uniform(0.01, 0.99, size - 2)), [1.0]]) for size in sizes)
    return (r, g, b)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_linear_functions_are_exact_on_any_levels(method: Interpolation) -> None:
    levels = _levels(RNG)
    matrix, offset = RNG.normal(size=(3, 3)), RNG.normal(size=3)
    lattice = Lattice(levels, grid(levels) @ matrix.T + offset, method)
    x = RNG.uniform(size=(500, 3))
    np.testing.assert_allclose(lattice(x), x @ matrix.T + offset, atol=1e-12)


@pytest.mark.parametrize("method", INTERPOLATIONS)
def test_nodes_are_met_and_outside_is_clamped(method: Interpolation) -> None:
    levels = _levels(RNG)
    lattice = Lattice(levels, RNG.uniform(size=(5, 7, 6, 3)), method)
    np.testing.assert_allclose(lattice(grid(levels)), lattice.values, atol=1e-12)
    x = RNG.uniform(-1.0, 2.0, size=(200, 3))
    np.testing.assert_allclose(lattice(x), lattice(np.clip(x, 0.0, 1.0)), atol=1e-12)


def test_trilinear_multiplies_and_tetrahedral_does_not() -> None:
    levels = uniform_levels(2)
    values = np.repeat(np.prod(grid(levels), axis=-1, keepdims=True), 3, axis=-1)  # 1 in one corner
    x = np.array([0.5, 0.25, 0.75])
    assert Lattice(levels, values, "trilinear")(x)[0] == pytest.approx(0.5 * 0.25 * 0.75)
    assert Lattice(levels, values, "tetrahedral")(x)[0] == pytest.approx(0.25)  # the least coordinate


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_values_stay_within_the_cell(seed: int) -> None:
    rng = np.random.default_rng(seed)
    levels = _levels(rng, (3, 4, 5))
    for method in INTERPOLATIONS:
        lattice = Lattice(levels, rng.uniform(-2.0, 3.0, size=(3, 4, 5, 3)), method)
        y = lattice(rng.uniform(size=(50, 3)))
        assert np.all(y >= lattice.values.min(axis=(0, 1, 2)) - 1e-12)
        assert np.all(y <= lattice.values.max(axis=(0, 1, 2)) + 1e-12)


def test_the_shape_of_the_input_is_kept() -> None:
    lattice = Lattice(uniform_levels(3), grid(uniform_levels(3)))
    assert lattice(np.zeros((4, 5, 3))).shape == (4, 5, 3)
    assert lattice(np.zeros(3)).shape == (3,)
    assert lattice(np.zeros((0, 3))).shape == (0, 3)
    assert lattice.size == (3, 3, 3)


@pytest.mark.parametrize(
    ("green", "blue", "values", "says"),
    [
        (LEVELS, LEVELS, np.zeros((3, 3, 2, 3)), "shape"),
        (LEVELS, LEVELS, np.full((3, 3, 3, 3), np.nan), "not a finite"),
        (LEVELS, LEVELS, np.full((3, 3, 3, 3), 1e30), "no colour"),
        ([0.0, 0.5, 0.5], LEVELS, np.zeros((3, 3, 3, 3)), "G node levels"),
        (LEVELS, [0.0, np.inf, 1.0], np.zeros((3, 3, 3, 3)), "B node levels"),
    ],
)
def test_bad_lattices_are_refused(green: list[float], blue: list[float], values: np.ndarray, says: str) -> None:
    with pytest.raises(ProfileError, match=says):
        Lattice((np.array(LEVELS), np.array(green), np.array(blue)), values)


def test_a_lattice_prints_as_its_size() -> None:
    assert repr(Lattice(uniform_levels(3), grid(uniform_levels(3)))) == "Lattice(3×3×3, trilinear)"
