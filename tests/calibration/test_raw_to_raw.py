"""RAW to RAW between two cameras of known sensitivities."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from samples_simulated import chart_140, photograph_patches

from lutforge.calibration.raw_to_raw import fit_raw_transfer, pair_samples
from lutforge.errors import CalibrationError
from lutforge.model.raw_transfer import RawTransfer
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.scene import palette
from lutforge.simulate.spectra import chart_reflectances, surface_reflectances

A, B = nikon_d5100(), sigma_sd_merrill()


def fit(light: str, piecewise: bool) -> RawTransfer:
    surfaces = np.vstack([chart_reflectances(), surface_reflectances()])
    neutral = 1 / A.multipliers(light)
    return fit_raw_transfer(A.name, B.name, A.expose(surfaces, light), B.expose(surfaces, light), neutral, piecewise)


def rendered_error(light: str, raw: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    got, wanted = (B.render(values, "standard", light) for values in (raw, truth))
    inside = np.all((wanted > 0.004) & (wanted < 0.996), axis=1)
    return float(np.sqrt(np.mean((got - wanted)[inside] ** 2)))


@pytest.mark.parametrize("piecewise", [False, True])
def test_other_colours_come_out_as_the_other_camera_sees_them(piecewise: bool) -> None:
    unseen = palette(600, np.random.default_rng(9))
    x, y = A.expose(unseen, "daylight"), B.expose(unseen, "daylight")
    matrices = (x * A.multipliers("daylight")) @ A.matrix.T @ np.linalg.inv(B.matrix).T / B.multipliers("daylight")
    error = rendered_error("daylight", fit("daylight", piecewise)(x), y)
    assert error <= (0.016 if piecewise else 0.02)
    assert error < rendered_error("daylight", matrices, y)


def test_the_piecewise_form_gains() -> None:
    unseen = palette(600, np.random.default_rng(9))
    for light in ("daylight", "tungsten", "cloudy"):
        x, y = A.expose(unseen, light), B.expose(unseen, light)
        one, several = (rendered_error(light, fit(light, piecewise)(x), y) for piecewise in (False, True))
        assert several < 0.95 * one


def test_a_fit_is_carried_over_to_other_lights() -> None:
    unseen = palette(600, np.random.default_rng(9))
    transfer = fit("daylight", True)
    x, y = A.expose(unseen, "tungsten"), B.expose(unseen, "tungsten")
    carried = transfer.under(A.multipliers("tungsten"), B.multipliers("tungsten"))(x)
    assert rendered_error("tungsten", carried, y) < 0.75 * rendered_error("tungsten", transfer(x), y)


def test_a_linear_relation_is_found_whatever_the_noise_free_colours() -> None:
    rng = np.random.default_rng(4)
    matrix = np.array([[0.9, 0.1, 0.0], [0.05, 1.1, -0.1], [0.0, 0.1, 0.8]])
    x = rng.uniform(0.05, 0.9, (60, 3))
    for piecewise in (False, True):
        transfer = fit_raw_transfer("a", "b", x, x @ matrix.T, np.array([0.5, 1.0, 0.6]), piecewise)
        np.testing.assert_allclose(transfer(x), x @ matrix.T, atol=1e-6)
        assert transfer.error is not None
        assert transfer.error < 1e-6


def test_patches_pair_by_name_and_shots_by_name_or_order() -> None:
    first = photograph_patches(A, chart_140(), balances=("daylight",), stops=(-2, -1))
    second = replace(first, camera=np.full(len(first), B.name), raw=0.5 * first.raw)
    x, y, neutral = pair_samples(first, second)
    np.testing.assert_allclose(y, 0.5 * x)
    assert neutral[1] == pytest.approx(1.0)
    renamed = replace(second, shot=np.char.add("other ", second.shot))
    np.testing.assert_array_equal(pair_samples(first, renamed)[1], y)
    with pytest.raises(CalibrationError, match="common to both"):
        pair_samples(first, replace(renamed, patch=np.char.add("p", second.patch)))


def test_colours_that_do_not_determine_it_are_refused() -> None:
    grey = np.linspace(0.1, 0.9, 20)[:, None] * np.ones(3)
    with pytest.raises(CalibrationError, match="all alike"):
        fit_raw_transfer("a", "b", grey, grey)
    with pytest.raises(CalibrationError, match="at least"):
        fit_raw_transfer("a", "b", grey[:3], grey[:3])
    with pytest.raises(CalibrationError, match="white"):
        colours = np.random.default_rng(0).random((20, 3))
        fit_raw_transfer("a", "b", colours, colours, piecewise=True)
