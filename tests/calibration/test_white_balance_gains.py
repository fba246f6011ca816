"""A common factor of a white-balance setting is found where there is one, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.steps import fit_gains
from lutforge.evaluation.evaluation import evaluate
from lutforge.pipeline.calibration import calibrate
from lutforge.reports.tables import balance_table
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import BALANCES, chart_140, photograph_patches

GAINS = (0.9, 0.95, 1.0, 1.05, 1.1)


def _photographed(gains: tuple[float, ...], patches: int) -> SampleSet:
    """The camera brings each setting's RAW up by its gain before it renders it."""
    samples = photograph_patches(nikon_d5100(), chart_140()[:patches], stops=(-3, -2, -1, 0))
    factor = np.array([gains[BALANCES.index(str(name))] for name in samples.white_balance])
    return replace(samples, raw=samples.raw / factor[:, None])


@pytest.mark.parametrize("patches", [24, 60])
@pytest.mark.parametrize("gains", [GAINS, (1.0, 1.0, 1.1, 1.0, 1.0), (1.0,) * 5])
def test_gains_are_found_and_none_is_invented(gains: tuple[float, ...], patches: int) -> None:
    samples = _photographed(gains, patches)
    found = fit_gains(CalibrationState(samples, samples.wb)).multipliers[:, 1]
    assert set(gains) != {1.0} or np.array_equal(found, samples.wb[:, 1])
    true = np.array([gains[BALANCES.index(str(name))] for name in samples.white_balance])
    np.testing.assert_allclose(found, true / np.median(gains), rtol=0.003)


@pytest.mark.slow
def test_settings_with_gains_calibrate_as_well_as_without() -> None:
    options = CalibrationOptions(size=9)
    errors = []
    for gains in ((1.0,) * 5, GAINS):
        samples = _photographed(gains, 60)
        profile = calibrate(samples, options)
        gain = profile.white_balances["shade"].gain
        assert gain == pytest.approx(gains[-1], rel=0.003)
        assert next(row for row in balance_table(profile).rows if row[0] == "shade")[2] == f"{gain:.4f}"
        errors.append(profile.styles["standard"].errors["render_mean"])
        evaluated = next(row for row in evaluate(profile, samples).rows if row.shot == "all")
        assert evaluated.figures.mean == pytest.approx(errors[-1], rel=0.25)
    assert errors[1] <= 1.05 * errors[0]
