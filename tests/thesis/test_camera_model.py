"""The thesis's camera model against the simulated camera's known truth, and its radial basis functions."""

import numpy as np
import pytest
from scipy.interpolate import RBFInterpolator

from lutforge.calibration.style import unclipped
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.errors import CalibrationError
from lutforge.model.gamut_map import GamutMap
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from lutforge.thesis.camera_model import fit_gamut_maps, fit_stages
from lutforge.thesis.gamut_map import fit_gamut_map, merge_coincident, solve
from lutforge.thesis.options import ThesisOptions
from tests.cases.samples import chart_140, photograph_patches, surfaces

CAMERA = nikon_d5100()


def _truth(samples: SampleSet) -> np.ndarray:
    return np.array([CAMERA.multipliers(str(name)) for name in samples.white_balance])


@pytest.mark.parametrize("style", ["standard", "vivid"])
@pytest.mark.parametrize("patches", [24, 140])
@pytest.mark.parametrize("known", [True, False])
def test_stages_from_exposure_pairs(style: str, patches: int, known: bool) -> None:
    """f has the scale of RAW, which pairs leave open; Ts and Tw follow from it."""
    samples = photograph_patches(CAMERA, chart_140()[:patches], styles=(style,), known=known)
    samples = samples.select(unclipped(samples, _truth(samples)))
    stages = fit_stages(samples, complete_multipliers(samples)[0], np.full(len(samples), known))
    assert np.linalg.norm(stages.matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
    np.testing.assert_allclose(stages.multipliers, _truth(samples), rtol=0.005)
    codes = np.stack([np.linspace(0.03, 0.95, 200)] * 3, axis=1)
    true = CAMERA.styles[style][1].inverse(codes)
    np.testing.assert_allclose(stages.responses[style].encode(true), codes, atol=0.005)


def test_both_gamut_maps_predict_colours_that_they_have_not_seen() -> None:
    """h and h⁻¹ of a vivid style, on other surfaces, in both directions."""
    style, balances = "vivid", ("tungsten", "daylight", "shade")
    samples = photograph_patches(CAMERA, chart_140(), styles=(style,), balances=balances)
    samples = samples.select(unclipped(samples, samples.wb))
    stages = fit_stages(samples, samples.wb, np.ones(len(samples), dtype=np.bool_))
    balanced, response = samples.raw * samples.wb, stages.responses[style]
    model = fit_gamut_maps(
        balanced, samples.srgb, samples.shot, stages.matrix, response, balances, ThesisOptions(centres=1_000)
    )
    others = photograph_patches(CAMERA, surfaces(300, 99), styles=(style,), balances=balances, exposure_error=0, seed=5)
    others = others.select(unclipped(others, others.wb))
    assert np.linalg.norm(model.render(others.raw * others.wb) - others.srgb, axis=1).mean() <= 0.02  # Fig. 5.5
    back = model.linearize(others.srgb) / others.wb - others.raw
    assert np.sqrt(np.mean(back**2)) <= 0.007  # thesis, Fig. 4.6


def test_the_gamut_map_weighs_all_colours_alike() -> None:
    linear = np.random.default_rng(3).uniform(0.02, 0.9, (300, 3))
    response = Response(np.linspace(0.0, 1.0, 256)[:, None] ** [2.2, 2.2, 2.2])
    encoded, shot = response.encode(linear**1.1), np.repeat(["a", "b", "c"], 100)
    options = ThesisOptions(rho=0.1 / (8.0 * 300 * np.pi))
    model = fit_gamut_maps(linear, encoded, shot, np.eye(3), response, (), options)
    mapped, maps = response.linearize(encoded), (model.gamut_map, model.inverse_gamut_map)
    for found, (x, y) in zip(maps, ((linear, mapped), (mapped, linear)), strict=True):
        alike = fit_gamut_map(x, y, rho=options.rho, groups=shot)
        np.testing.assert_array_equal(found(x), alike(x))  # (4.8)


# --- The thesis's radial basis functions: exactness, smoothing, the greedy choice, coincident points ------------------


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
