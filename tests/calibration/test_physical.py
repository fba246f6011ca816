"""The whole physical model against the simulated camera, on colours and shots that it was not fitted to."""

import numpy as np
import pytest

from lutforge.calibration.options import PhysicalOptions
from lutforge.calibration.physical.gamut_map import fit_gamut_map
from lutforge.calibration.physical.kriging import fit_camera_model
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.physical_model import fit_gamut_maps, fit_stages
from lutforge.calibration.physical.unsaturated import untouched
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from tests.cases.samples import chart_140, photograph_patches, surfaces

CAMERA = nikon_d5100()


def _truth(samples: SampleSet) -> np.ndarray:
    return np.array([CAMERA.multipliers(str(name)) for name in samples.white_balance])


@pytest.mark.parametrize(("style", "patches"), [("vivid", 24), ("landscape", 24), ("vivid", 140)])
def test_ground_truth_of_a_sensor_whose_channels_overlap(style: str, patches: int) -> None:
    """The limits hold with every multiplier unknown, and on a small chart that a strong gamut map moves most of."""
    camera = sigma_sd_merrill()
    balances = ("tungsten", "daylight", "shade")
    samples = photograph_patches(camera, chart_140()[:patches], styles=(style,), balances=balances, known=False)
    truth = np.array([camera.multipliers(str(name)) for name in samples.white_balance])
    inside = unclipped(samples, truth)
    samples, truth = samples.select(inside), truth[inside]
    stages = fit_stages(samples, complete_multipliers(samples)[0], np.zeros(len(samples), dtype=np.bool_))
    assert np.linalg.norm(stages.matrix - camera.matrix) < 0.005 * np.linalg.norm(camera.matrix)
    np.testing.assert_allclose(stages.multipliers, truth, rtol=0.003)
    response = stages.responses[style]
    plain = samples.srgb[untouched(samples.srgb)]  # beyond the brightest of them f is continued
    for channel in range(3):
        values = plain[:, channel]
        codes = np.stack([np.linspace(values.min(), values.max(), 300)] * 3, axis=1)
        error = response.encode(camera.styles[style][1].inverse(codes)) - codes
        assert np.abs(error[:, channel]).max() < 0.005
    if patches < 100:
        return
    balanced = samples.raw * stages.multipliers
    model = fit_camera_model(MatrixAndResponse(stages.matrix, response), balanced, samples.srgb, balances)
    others = photograph_patches(
        camera, surfaces(300, 99), styles=(style,), balances=balances, exposure_error=0.0, seed=5
    )
    others = others.select(unclipped(others, others.wb))
    assert np.linalg.norm(model.render(others.raw * others.wb) - others.srgb, axis=1).mean() <= 0.003
    back = model.linearize(others.srgb) / others.wb - others.raw
    assert np.sqrt(np.mean(back**2)) <= 0.003


@pytest.mark.parametrize("style", ["standard", "vivid"])
@pytest.mark.parametrize("patches", [24, 140])
@pytest.mark.parametrize("known", [True, False])
def test_the_thesis_preset_from_exposure_pairs(style: str, patches: int, known: bool) -> None:
    """f has the scale of RAW, which pairs leave open; Ts and Tw follow from it."""
    samples = photograph_patches(CAMERA, chart_140()[:patches], styles=(style,), known=known)
    samples = samples.select(unclipped(samples, _truth(samples)))
    stages = fit_stages(samples, complete_multipliers(samples)[0], np.full(len(samples), known), "thesis")
    assert np.linalg.norm(stages.matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
    np.testing.assert_allclose(stages.multipliers, _truth(samples), rtol=0.005)
    codes = np.stack([np.linspace(0.03, 0.95, 200)] * 3, axis=1)
    true = CAMERA.styles[style][1].inverse(codes)
    np.testing.assert_allclose(stages.responses[style].encode(true), codes, atol=0.005)


def test_the_thesis_preset_weighs_all_colours_of_the_gamut_map_alike() -> None:
    linear = np.random.default_rng(3).uniform(0.02, 0.9, (300, 3))
    response = Response(np.linspace(0.0, 1.0, 256)[:, None] ** [2.2, 2.2, 2.2])
    encoded, shot = response.encode(linear**1.1), np.repeat(["a", "b", "c"], 100)
    physical = PhysicalOptions(rho=0.1 / (8.0 * 300 * np.pi))
    model = fit_gamut_maps(linear, encoded, shot, np.eye(3), response, (), physical)
    mapped, maps = response.linearize(encoded), (model.gamut_map, model.inverse_gamut_map)
    for found, (x, y) in zip(maps, ((linear, mapped), (mapped, linear)), strict=True):
        alike = fit_gamut_map(x, y, rho=physical.rho, groups=shot)
        np.testing.assert_array_equal(found(x), alike(x))  # (4.8)
