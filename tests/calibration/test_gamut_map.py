"""The camera model against the simulated camera, on colours and shots that it was not fitted to."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.gamut_map import NOISE, krige, likely_roughness
from lutforge.calibration.matrix_and_response import fit_matrix_and_response, plainly_unsaturated
from lutforge.calibration.style import unclipped
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.errors import CalibrationError
from lutforge.model.gamut_map import ROUGHNESS, kriging_covariance
from lutforge.simulate.camera import sigma_sd_merrill
from tests.cases.samples import chart_140, photograph_patches, style_of, surfaces


@pytest.mark.parametrize(("style", "patches"), [("vivid", 24), ("landscape", 24), ("vivid", 140)])
def test_ground_truth_of_a_sensor_whose_channels_overlap(style: str, patches: int) -> None:
    """The limits hold on a small chart, too, that a strong gamut map moves most of."""
    camera = sigma_sd_merrill()
    balances = ("tungsten", "daylight", "shade")
    samples = photograph_patches(camera, chart_140()[:patches], styles=(style,), balances=balances, known=False)
    truth = np.array([camera.multipliers(str(name)) for name in samples.white_balance])
    inside = unclipped(samples, truth)
    samples, truth = samples.select(inside), truth[inside]
    np.testing.assert_allclose(complete_multipliers(samples)[0], truth, rtol=0.015)
    balanced = samples.raw * truth
    base = fit_matrix_and_response(balanced, samples.srgb, saturates=True)
    assert np.linalg.norm(base.matrix - camera.matrix) < (0.005 if patches == 140 else 0.025) * np.linalg.norm(
        camera.matrix
    )
    response = base.response
    plain = samples.srgb[plainly_unsaturated(samples.srgb)]  # beyond the brightest of them f is continued
    for channel in range(3):
        values = plain[:, channel]
        codes = np.stack([np.linspace(values.min(), values.max(), 300)] * 3, axis=1)
        error = response.encode(camera.styles[style][1].inverse(codes)) - codes
        assert np.abs(error[:, channel]).max() < 0.005
    if patches < 100:
        return
    model = replace(style_of(balanced, samples.srgb), given=base).model
    others = photograph_patches(camera, surfaces(300, 99), styles=(style,), balances=balances, exposure_error=0, seed=5)
    others = others.select(unclipped(others, others.wb))
    assert np.linalg.norm(model.render(others.raw * others.wb) - others.srgb, axis=1).mean() <= 0.003
    back = model.linearize(others.srgb) / others.wb - others.raw
    assert np.sqrt(np.mean(back**2)) <= 0.003


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_colours_that_are_no_numbers_are_refused(number: float) -> None:
    source = np.random.default_rng(0).random((50, 3))
    target = source.copy()
    target[7, 1] = number
    with pytest.raises(CalibrationError, match="not finite, or far beyond 1"):
        krige(source, target, np.ones(50), 50)


@pytest.mark.parametrize("number", [np.nan, np.inf])
def test_numbers_that_are_not_finite_are_refused(number: float) -> None:
    source = np.random.default_rng(0).random((200, 3))
    target = source**1.1
    target[5, 1] = number
    with pytest.raises(CalibrationError, match="not finite"):
        krige(source, target, np.ones(200), 4000)


@pytest.mark.parametrize("roughness", [0.02, 0.1, 0.5, 1.5])
def test_the_roughness_of_a_known_process_is_found(roughness: float) -> None:
    found = []
    for seed in range(4):
        rng = np.random.default_rng(seed)
        z = rng.random((400, 3))
        covariance = kriging_covariance(z, roughness=roughness)
        covariance += np.tril(covariance, -1).T + NOISE * np.eye(len(z))
        correction = 0.03 * np.linalg.cholesky(covariance) @ rng.normal(size=(len(z), 3))
        found.append(likely_roughness(z, correction, np.ones(len(z))))
    assert roughness / 2 < np.median(found) < 2 * roughness


def test_nothing_to_correct_has_the_usual_roughness() -> None:
    z = np.random.default_rng(0).random((50, 3))
    assert likely_roughness(z, np.zeros_like(z), np.ones(len(z))) == ROUGHNESS
