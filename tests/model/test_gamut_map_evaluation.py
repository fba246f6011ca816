"""Evaluation of the radial basis functions against the formula (4.7) in plain numpy."""

import numpy as np
import pytest

from lutforge.errors import ProfileError
from lutforge.model.gamut_map import GamutMap, even_slope, from_even, to_even


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


def test_evaluation_on_the_even_scale_is_the_formula_there() -> None:
    rng = np.random.default_rng(3)
    centres, coefficients = rng.uniform(size=(60, 3)), rng.normal(size=(60, 3)) / 50
    polynomial = np.vstack([np.zeros(3), np.eye(3)])
    x = rng.uniform(-0.2, 1.2, size=(300, 3))
    even, knots = to_even(x, 0.01), to_even(centres, 0.01)
    expected = np.linalg.norm(even[:, None, :] - knots[None], axis=2) @ coefficients + even
    got = GamutMap(centres, coefficients, polynomial, offset=0.01)(x)
    np.testing.assert_allclose(to_even(got, 0.01), expected, atol=5e-6)


@pytest.mark.parametrize("offset", [0.0, 0.005, 0.1])
def test_the_even_scale_and_back(offset: float) -> None:
    x = np.linspace(-0.5, 2.0, 501)
    even = to_even(x, offset)
    np.testing.assert_allclose(from_even(even, offset), x, atol=1e-12)
    assert np.all(np.diff(even) > 0)
    np.testing.assert_allclose(to_even([0.0, 1.0], offset), [0.0, 1.0], atol=1e-12)
    if offset:
        middle = 0.5 * (x[1:] + x[:-1])
        np.testing.assert_allclose(even_slope(middle, offset), np.diff(even) / np.diff(x), rtol=0.03)


def test_bad_parts_are_refused() -> None:
    with pytest.raises(ProfileError, match="expected n centres"):
        GamutMap(np.zeros((2, 3)), np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="not finite"):
        GamutMap(np.zeros((1, 3)), np.full((1, 3), np.inf), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="offset"):
        GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((4, 3)), offset=-0.1)
