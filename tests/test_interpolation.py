import numpy as np
import pytest

from lutforge.arrays import Array
from lutforge.interpolation import indexed, locate


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
