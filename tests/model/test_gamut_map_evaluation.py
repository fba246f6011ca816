"""Evaluation of the radial basis functions against the formula (4.7) in plain numpy."""

import numpy as np
import pytest

from lutforge.errors import ProfileError
from lutforge.model.gamut_map import GamutMap, even_slope, from_even, to_even


@pytest.mark.parametrize(("count", "offset"), [(1, 0.0), (5, 0.0), (127, 0.0), (128, 0.0), (1000, 0.0), (60, 0.01)])
def test_evaluation_is_the_formula(count: int, offset: float) -> None:
    rng = np.random.default_rng(count)
    centres, coefficients = rng.uniform(size=(count, 3)), rng.normal(size=(count, 3)) / (50 if offset else count**0.5)
    polynomial = np.vstack([np.zeros(3), np.eye(3)]) if offset else rng.normal(size=(4, 3))
    x = rng.uniform(-0.2, 1.2, size=(300, 3))
    even, knots = to_even(x, offset), to_even(centres, offset)
    distance = np.linalg.norm(even[:, None, :] - knots[None], axis=2)
    expected = distance @ coefficients + polynomial[0] + even @ polynomial[1:]
    gamut_map = GamutMap(centres, coefficients, polynomial, offset)
    np.testing.assert_allclose(to_even(gamut_map(x), offset), expected, atol=5e-6)
    assert gamut_map(x.reshape(10, 30, 3)).shape == (10, 30, 3)


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
