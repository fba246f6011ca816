"""The thesis's gamut map: exactness, smoothing, the greedy choice of centres, coincident points."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from lutforge.errors import CalibrationError
from lutforge.model.gamut_map import GamutMap
from lutforge.thesis.gamut_map import fit_gamut_map, merge_coincident, solve

RNG = np.random.default_rng(0)


def _curved(x: np.ndarray) -> np.ndarray:
    return np.asarray(x + 0.08 * np.sin(5 * x[:, [1, 2, 0]]) * x)


def worst(fit: GamutMap, source: np.ndarray, target: np.ndarray) -> float:
    return float(np.linalg.norm(fit(source) - target, axis=1).max())


@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_it_is_scipys_linear_rbf(smoothing: float) -> None:
    """Its kernel is −r, so its smoothing is our 8Nπρ, with the thesis's sign."""
    x = RNG.uniform(size=(300, 3))
    y, probe = _curved(x) + 0.01 * RNG.standard_normal(x.shape), RNG.uniform(size=(500, 3))
    expected = RBFInterpolator(x, y, kernel="linear", degree=1, smoothing=smoothing)(probe)
    np.testing.assert_allclose(solve(x, y, smoothing)(probe), expected, atol=3e-6)


def test_rho_counts_with_the_number_of_centres() -> None:
    """N of (4.8) is the number of points that the system has, not the most that it may have."""
    x = RNG.uniform(size=(60, 3))
    y, probe = _curved(x), RNG.uniform(size=(100, 3))
    fit, expected = fit_gamut_map(x, y, rho=1e-4), solve(x, y, 8 * 60 * np.pi * 1e-4)
    assert len(fit.centres) == 60
    np.testing.assert_allclose(fit(probe), expected(probe), atol=1e-6)


def test_linear_maps_need_no_centres_but_the_first() -> None:
    x = RNG.uniform(size=(5000, 3))
    matrix = np.array([[1.2, -0.1, -0.1], [0.0, 1.0, 0.0], [0.1, -0.2, 1.1]])
    fit = fit_gamut_map(x, x @ matrix.T + 0.01, tolerance=1e-4, rho=0.0)
    assert len(fit.centres) == 64
    assert worst(fit, x, x @ matrix.T + 0.01) < 1e-4
    outside = RNG.uniform(1.5, 3.0, (10, 3))
    np.testing.assert_allclose(fit(outside), outside @ matrix.T + 0.01, atol=1e-3)


def test_the_tolerance_is_met_with_few_centres() -> None:
    x = RNG.uniform(size=(6000, 3))
    fit = fit_gamut_map(x, _curved(x), tolerance=0.004, rho=0.0)
    assert worst(fit, x, _curved(x)) <= 0.004
    assert len(fit.centres) < 3000
    probe = RNG.uniform(0.05, 0.95, (2000, 3))
    assert np.linalg.norm(fit(probe) - _curved(probe), axis=1).max() < 0.006


def test_the_cap_is_kept_and_the_worst_come_first() -> None:
    x = RNG.uniform(size=(3000, 3))
    few, many = (fit_gamut_map(x, _curved(x), tolerance=1e-9, most=most, rho=0.0) for most in (100, 800))
    assert len(few.centres) == 100 and len(many.centres) == 800
    assert worst(many, x, _curved(x)) < 0.6 * worst(few, x, _curved(x))


def test_noise_is_smoothed_by_the_choice_on_held_out_shots() -> None:
    x = RNG.uniform(size=(600, 3))
    noisy = _curved(x) + 0.02 * RNG.standard_normal(x.shape)
    shots = np.array([f"shot {place % 6}" for place in range(600)])
    chosen = fit_gamut_map(x, noisy, groups=shots)
    plain = fit_gamut_map(x, noisy, rho=0.0)
    probe = RNG.uniform(0.1, 0.9, (2000, 3))
    errors = [np.linalg.norm(fit(probe) - _curved(probe), axis=1).mean() for fit in (chosen, plain)]
    assert errors[0] < 0.8 * errors[1]


def test_coincident_points_take_the_median() -> None:
    source = np.repeat([[0.2, 0.3, 0.4], [0.7, 0.6, 0.5]], [5, 1], axis=0)
    target = np.array([[0.1] * 3, [0.2] * 3, [0.3] * 3, [0.3] * 3, [9.0] * 3, [0.5] * 3])
    merged, values, names = merge_coincident(source, target, np.array(list("abcdef")), 0.5 / 255)
    assert len(merged) == len(names) == 2
    np.testing.assert_allclose(values[np.argmin(merged[:, 0])], 0.3)
    np.testing.assert_allclose(values[np.argmax(merged[:, 0])], 0.5)


def test_colours_in_a_plane_are_refused() -> None:
    flat = RNG.uniform(size=(100, 3)) * [1, 1, 0]
    with pytest.raises(CalibrationError, match="many colours"):
        fit_gamut_map(flat, flat)
