"""The nonuniform lattice: interpolation against known functions, and the values that it refuses."""

import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.errors import ProfileError
from lutforge.interpolation import INTERPOLATIONS, Interpolation, Levels, indexed, locate
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


def crowded(count: int, power: float) -> Array:
    """Levels that stand the closer, the nearer to the low end they are, on an axis that is not [0, 1]."""
    return 3.0 * np.linspace(0.0, 1.0, count) ** power - 0.5


@pytest.mark.parametrize("count", [2, 3, 33, 65])
@pytest.mark.parametrize("power", [0.3, 1.0, 2.4, 9.0])
def test_each_number_is_in_its_cell(count: int, power: float) -> None:
    levels = crowded(count, power)
    axis = indexed((levels, levels, levels))[0]
    beside = [np.nextafter(levels, end) for end in (-np.inf, np.inf)]
    x = np.concatenate([levels, *beside, np.random.default_rng(1).uniform(-1.0, 3.0, 2000), [-np.inf, np.inf]])
    found = [locate(axis, number) for number in x]
    cell, inside = np.clip(np.searchsorted(levels, x, side="right") - 1, 0, count - 2), np.clip(x, -0.5, levels[-1])
    assert [i for i, _ in found] == cell.tolist()
    assert np.array_equal([f for _, f in found], (inside - levels[cell]) / (levels[cell + 1] - levels[cell]))


def test_what_is_no_number_is_at_the_first_node() -> None:
    levels = crowded(9, 2.0)
    assert locate(indexed((levels, levels, levels))[0], np.nan) == (0, 0.0)
