"""Ts and Tw of the simulated camera, with multipliers known, partly known, and unknown (4.5)."""

import numpy as np
import pytest

from lutforge.calibration.matrix_and_response import plainly_unsaturated
from lutforge.calibration.options import BETA
from lutforge.calibration.style import unclipped
from lutforge.colour.saturation import saturation
from lutforge.simulate.camera import nikon_d5100
from lutforge.thesis.camera_model import KNOWN, fit_matrix
from tests.cases.samples import BALANCES, chart_140, photograph_patches

CAMERA = nikon_d5100()
SAMPLES = photograph_patches(CAMERA, chart_140())
SAMPLES = SAMPLES.select(unclipped(SAMPLES, SAMPLES.wb))
LINEAR = CAMERA.styles["standard"][1].inverse(SAMPLES.srgb)
PLAIN = plainly_unsaturated(SAMPLES.srgb)
BALANCED, ALL_KNOWN = SAMPLES.raw * SAMPLES.wb, np.full(len(SAMPLES), KNOWN)


@pytest.mark.parametrize("known", [BALANCES, ("daylight",), ()])
def test_matrix_and_multipliers_are_the_cameras(known: tuple[str, ...]) -> None:
    is_known = np.isin(SAMPLES.white_balance, known)
    raw = np.where(is_known[:, None], SAMPLES.raw * SAMPLES.wb, SAMPLES.raw)
    setting = np.where(is_known, KNOWN, SAMPLES.white_balance)
    matrix, multipliers = fit_matrix(LINEAR, raw, setting, unsaturated=PLAIN)
    assert np.linalg.norm(matrix - CAMERA.matrix) < 0.01 * np.linalg.norm(CAMERA.matrix)
    for name in np.unique(SAMPLES.white_balance[~is_known]):
        np.testing.assert_allclose(multipliers[name], CAMERA.multipliers(name), rtol=0.005)
        assert multipliers[name][1] == 1.0


def test_colours_near_white_are_what_turns_the_plain_fit() -> None:
    """The thesis's threshold β alone lets them in."""
    every = saturation(SAMPLES.srgb) < BETA
    error = {}
    for name, plain in (("β", every), ("not near white", PLAIN)):
        matrix, _ = fit_matrix(LINEAR, BALANCED, ALL_KNOWN, unsaturated=plain)
        error[name] = np.linalg.norm(matrix - CAMERA.matrix) / np.linalg.norm(CAMERA.matrix)
    assert error["not near white"] < 0.005 < 0.02 < error["β"]
