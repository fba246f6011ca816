"""The thesis's camera model against the known truth of the simulated camera."""

import numpy as np
import pytest

from lutforge.calibration.style import unclipped
from lutforge.calibration.white_balance import complete_multipliers
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from lutforge.thesis.camera_model import fit_gamut_maps, fit_stages
from lutforge.thesis.gamut_map import fit_gamut_map
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
