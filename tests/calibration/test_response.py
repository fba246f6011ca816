"""The response against the simulated camera's known one, and against plain curves."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.physical.curve_basis import gamma_response, srgb_response
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.physical.response_from_exposures import (
    fit_response_to_exposures,
    pairs_of_bracket,
    pairs_of_samples,
)
from lutforge.calibration.physical.unsaturated import BETA, check_tones, saturation
from lutforge.calibration.style import unclipped
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100
from lutforge.solvers.solution import Status
from tests.cases.samples import chart_140, photograph_patches

Array = NDArray[np.float64]
CAMERA = nikon_d5100()


@cache
def _samples(style: str) -> SampleSet:
    samples = photograph_patches(CAMERA, chart_140(), styles=(style,))
    return samples.select(unclipped(samples, samples.wb))


def _worst(response: Response, style: str, encoded: Array, *, scaled: bool = False) -> float:
    """Largest error of f inside the range that the samples span; scaled: with the best factor in front of each f⁻¹."""
    worst = 0.0
    true = CAMERA.styles[style][1]
    for channel in range(3):
        codes = np.linspace(encoded[:, channel].min(), encoded[:, channel].max(), 500)
        linear = true.inverse(np.stack([codes] * 3, axis=1))
        factors = np.exp(np.linspace(-0.5, 0.5, 251)) if scaled else [1.0]
        errors = [np.abs(response.encode(linear * factor)[:, channel] - codes).max() for factor in factors]
        worst = max(worst, float(min(errors)))
    return worst


@pytest.mark.parametrize("style", ["standard", "vivid"])
def test_f_and_ts_from_raw_are_the_cameras(style: str) -> None:
    samples = _samples(style)
    fit = fit_matrix_and_response(samples.raw * samples.wb, samples.srgb)
    assert fit.status is Status.CONVERGED
    assert _worst(fit.response, style, samples.srgb) < 0.005
    assert np.linalg.norm(fit.matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)


def test_f_from_exposure_times_that_are_off_by_three_percent() -> None:
    samples = _samples("standard")
    blind = replace(samples, raw=np.zeros_like(samples.raw))  # a camera without RAW
    fit = fit_response_to_exposures(pairs_of_samples(blind))
    middle = np.clip(samples.srgb, 0.03, 0.97)
    assert _worst(fit.response, "standard", middle, scaled=True) < 0.005
    assert fit.response.inverse[-1] == pytest.approx([1.0, 1.0, 1.0])


def test_each_shots_exposure_error_is_found() -> None:
    samples = _samples("standard")
    blind = replace(samples, raw=np.zeros_like(samples.raw))
    fit = fit_response_to_exposures(pairs_of_samples(blind))
    first, second = "standard daylight -2", "standard daylight -1"
    one, other = samples.select(samples.shot == first), samples.select(samples.shot == second)
    _, a, b = np.intersect1d(one.patch, other.patch, return_indices=True)
    bright = one.raw[a].min(axis=1) > 0.01
    truth = float(np.median(other.raw[b][bright] / one.raw[a][bright])) / 2.0
    assert abs(truth - 1.0) > 0.005  # or there is nothing to find
    assert np.exp(fit.shot_error[second] - fit.shot_error[first]) == pytest.approx(truth, abs=0.006)


def test_f_from_exposure_pairs_whose_ratio_raw_tells() -> None:
    samples = _samples("standard")
    for preset in ("lutforge", "thesis"):
        fit = fit_response_to_exposures(pairs_of_samples(samples), preset)
        assert _worst(fit.response, "standard", np.clip(samples.srgb, 0.03, 0.97), scaled=True) < 0.005


def test_the_fitted_curve_always_rises() -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(0.02, 0.9, (80, 1)) * np.ones((1, 3))
    noisy = np.clip(x ** (1 / 2.2) + 0.03 * rng.standard_normal((80, 3)), 0.01, 0.99)
    fit = fit_matrix_and_response(x * (1 + 0.02 * rng.standard_normal((80, 3))), noisy)
    assert np.all(np.diff(fit.response.inverse, axis=0) >= 0)


def test_plain_curves() -> None:
    v = np.array([[0.0, 0.2, 1.0]])
    np.testing.assert_allclose(srgb_response().linearize(v)[0], [0.0, 0.0331048, 1.0], atol=1e-5)
    np.testing.assert_allclose(gamma_response(2.0).linearize(v)[0], [0.0, 0.04, 1.0], atol=1e-5)
    with pytest.raises(CalibrationError, match="gamma"):
        gamma_response(0.0)


def test_what_cannot_be_determined_says_what_to_shoot() -> None:
    grey = np.full((60, 3), 0.5) + 0.01 * np.random.default_rng(0).standard_normal((60, 3))
    with pytest.raises(CalibrationError, match="several exposures"):
        check_tones(grey, saturation(grey) < BETA)
    with pytest.raises(CalibrationError, match="one exposure only"):
        pairs_of_bracket(["a", "b"], [np.zeros((64, 64, 3))] * 2, [0.1, 0.1])
    with pytest.raises(CalibrationError, match="share flat, unclipped"):
        pairs_of_bracket(["a", "b"], [np.zeros((64, 64, 3)), np.ones((64, 64, 3))], [0.1, 0.2])


def test_other_scenes_under_the_same_patch_names_are_no_pairs() -> None:
    first = photograph_patches(CAMERA, chart_140(0)[24:], balances=("daylight",), stops=(0,))
    other = photograph_patches(CAMERA, chart_140(5)[24:], balances=("daylight",), stops=(-1,))
    with pytest.raises(CalibrationError, match="same surfaces"):
        pairs_of_samples(concatenate([first, other]))
