"""Evaluation of the radial basis functions against the formula (4.7) in plain numpy."""

import numpy as np
import pytest

from lutforge.errors import ProfileError
from lutforge.model.gamut_map import GamutMap


@pytest.mark.parametrize("count", [1, 5, 127, 128, 129, 1000])
def test_evaluation_is_the_formula(count: int) -> None:
    rng = np.random.default_rng(count)
    centres, coefficients = rng.uniform(size=(count, 3)), rng.normal(size=(count, 3)) / np.sqrt(count)
    polynomial = rng.normal(size=(4, 3))
    x = rng.uniform(-0.2, 1.2, size=(300, 3))
    distance = np.linalg.norm(x[:, None, :] - centres[None], axis=2)
    expected = distance @ coefficients + polynomial[0] + x @ polynomial[1:]
    got = GamutMap(centres, coefficients, polynomial)(x)
    np.testing.assert_allclose(got, expected, atol=5e-6)
    assert GamutMap(centres, coefficients, polynomial)(x.reshape(10, 30, 3)).shape == (10, 30, 3)


def test_bad_parts_are_refused() -> None:
    with pytest.raises(ProfileError, match="expected n centres"):
        GamutMap(np.zeros((2, 3)), np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="not finite"):
        GamutMap(np.zeros((1, 3)), np.full((1, 3), np.inf), np.zeros((4, 3)))
