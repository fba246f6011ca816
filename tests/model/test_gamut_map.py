"""Gamut maps: radial basis functions against the formula (4.7) in plain numpy."""

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from lutforge.errors import ProfileError
from lutforge.model.gamut_map import REACH, GamutMap, flattened, from_even, identity_gamut_map, to_even


@pytest.mark.parametrize(("count", "offset"), [(1, 0.0), (5, 0.0), (127, 0.0), (128, 0.0), (1000, 0.0), (60, 0.01)])
def test_evaluation_is_the_formula(count: int, offset: float) -> None:
    rng = np.random.default_rng(count)
    centres, coefficients = rng.uniform(size=(count, 3)), rng.normal(size=(count, 3)) / (50 if offset else count**0.5)
    polynomial = np.vstack([np.zeros(3), np.eye(3)]) if offset else rng.normal(size=(4, 3))
    x = rng.uniform(-0.2, 1.2, size=(300, 3))
    even, knots = to_even(x, offset), to_even(centres, offset)
    distance = np.linalg.norm(even[:, None, :] - knots[None], axis=2)
    expected = distance @ coefficients + polynomial[0] + even @ polynomial[1:]
    gamut_map = GamutMap(centres, coefficients, polynomial, offset, correction_offset=offset)
    np.testing.assert_allclose(to_even(gamut_map(x), offset), expected, atol=5e-6)
    assert gamut_map(x.reshape(10, 30, 3)).shape == (10, 30, 3)


@pytest.mark.parametrize("offset", [0.0, 0.005, 0.1])
def test_the_even_scale_and_back(offset: float) -> None:
    x = np.linspace(-0.5, 2.0, 501)
    even = to_even(x, offset)
    np.testing.assert_allclose(from_even(even, offset), x, atol=1e-12)
    assert np.all(np.diff(even) > 0)
    np.testing.assert_allclose(to_even([0.0, 1.0], offset), [0.0, 1.0], atol=1e-12)


def test_kriging_is_the_sum_of_its_kernel_up_to_twice_as_far_as_its_centres() -> None:
    rng = np.random.default_rng(0)
    centres, coefficients = rng.random((700, 3)), rng.normal(size=(700, 3))
    coefficients *= 2000 / np.abs(coefficients).sum(axis=0)
    coefficients -= coefficients.mean(axis=0)  # as of a fit, whose long parts cancel
    gamut_map = GamutMap(centres, coefficients, identity_gamut_map().polynomial, 0.005, "kriging", 0.3, 0.05)
    x = np.concatenate([rng.random((300, 3)), rng.uniform(-0.3, 3.0, (300, 3))])
    even = to_even(x, 0.005)
    distance = cdist(flattened(even), flattened(to_even(centres, 0.005))) / REACH
    near = 0.8 * (1 + 8 * distance) * np.exp(-8 * distance)
    kernel = 0.3 * np.exp(-distance) + near + 3 * np.exp(-3 * distance**2)
    np.testing.assert_allclose(to_even(gamut_map(x), 0.05), to_even(x, 0.05) + kernel @ coefficients, rtol=0, atol=1e-4)


def test_bad_parts_are_refused() -> None:
    with pytest.raises(ProfileError, match="expected n centres"):
        GamutMap(np.zeros((2, 3)), np.zeros((3, 3)), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="not finite"):
        GamutMap(np.zeros((1, 3)), np.full((1, 3), np.inf), np.zeros((4, 3)))
    with pytest.raises(ProfileError, match="offset"):
        GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((4, 3)), offset=-0.1)
    with pytest.raises(ProfileError, match="one scale"):
        GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.zeros((4, 3)), 0.02, correction_offset=0.05)
