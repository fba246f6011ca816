"""Ts and Tw against the simulated camera's, with multipliers known, partly known, and unknown."""

import numpy as np
import pytest

from lutforge.calibration.options import Preset
from lutforge.calibration.physical.physical_model import KNOWN, fit_matrix
from lutforge.calibration.physical.unsaturated import BETA, saturation, untouched
from lutforge.calibration.style import unclipped
from lutforge.errors import CalibrationError
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import BALANCES, chart_140, photograph_patches

CAMERA = nikon_d5100()
SAMPLES = photograph_patches(CAMERA, chart_140())
SAMPLES = SAMPLES.select(unclipped(SAMPLES, SAMPLES.wb))
LINEAR = CAMERA.styles["standard"][1].inverse(SAMPLES.srgb)
TRUSTED = untouched(SAMPLES.srgb).astype(np.float64)
BALANCED, ALL_KNOWN = SAMPLES.raw * SAMPLES.wb, np.full(len(SAMPLES), KNOWN)


@pytest.mark.parametrize("known", [BALANCES, ("daylight",), ()])
@pytest.mark.parametrize("preset", ["lutforge", "thesis"])
def test_matrix_and_multipliers_are_the_cameras(known: tuple[str, ...], preset: Preset) -> None:
    is_known = np.isin(SAMPLES.white_balance, known)
    raw = np.where(is_known[:, None], SAMPLES.raw * SAMPLES.wb, SAMPLES.raw)
    setting = np.where(is_known, KNOWN, SAMPLES.white_balance)
    matrix, multipliers = fit_matrix(LINEAR, raw, setting, trusted=TRUSTED, preset=preset)
    assert np.linalg.norm(matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
    for name in np.unique(SAMPLES.white_balance[~is_known]):
        np.testing.assert_allclose(multipliers[name], CAMERA.multipliers(name), rtol=0.005)
        assert multipliers[name][1] == 1.0


def test_colours_near_white_are_what_turns_the_plain_fit() -> None:
    """The thesis's threshold β alone lets them in; the robust fit tells them by their residual."""
    every = (saturation(SAMPLES.srgb) < BETA).astype(np.float64)
    error = {}
    for name, trusted in (("β", every), ("not near white", TRUSTED)):
        matrix, _ = fit_matrix(LINEAR, BALANCED, ALL_KNOWN, trusted=trusted, preset="thesis")
        error[name] = np.linalg.norm(matrix - CAMERA.matrix) / np.linalg.norm(CAMERA.matrix)
    assert error["not near white"] < 0.005 < 0.02 < error["β"]


def test_strays_do_not_turn_the_robust_fit() -> None:
    rng = np.random.default_rng(0)
    raw = BALANCED.copy()
    strays = rng.permutation(len(raw))[: len(raw) // 20]
    raw[strays] *= rng.uniform(0.5, 2.0, (len(strays), 3))
    matrix, _ = fit_matrix(LINEAR, raw, ALL_KNOWN, trusted=TRUSTED)
    assert np.linalg.norm(matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)


def test_colours_that_cannot_tell_the_matrix_are_refused() -> None:
    setting = np.full(40, "daylight")
    grey = np.linspace(0.05, 0.9, 40)[:, None] * np.ones((1, 3))
    with pytest.raises(CalibrationError, match="colour chart"):
        fit_matrix(grey, grey, setting, trusted=np.ones(40))
    with pytest.raises(CalibrationError, match="0 unsaturated colours"):
        fit_matrix(grey, grey, setting, trusted=np.zeros(40))
