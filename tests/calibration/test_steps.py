"""The steps of a calibration: what they fit, and how often."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration import calibration_state, steps, style
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.matrix_and_response import MatrixAndResponseFit, fit_matrix_and_response
from lutforge.calibration.options import CalibrationOptions
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import (
    chart_140,
    lost_stops,
    photograph_patches,
    spread_over_picture,
    with_dark_corners,
    with_gamma,
)

STYLES = ("standard", "vivid")


@pytest.fixture
def fits(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """The numbers of samples of all fits of matrix and response to the samples of a style, in their order."""
    counts: list[int] = []

    def counted(x: np.ndarray, *rest: object, **options: object) -> MatrixAndResponseFit:
        counts.append(len(x))
        return fit_matrix_and_response(x, *rest, **options)  # type: ignore[arg-type]  # as it was called

    for module in (calibration_state, style):
        monkeypatch.setattr(module, "fit_matrix_and_response", counted)
    return counts


def _shots(balances: tuple[str, ...] = ("daylight", "shade")) -> SampleSet:
    patches = photograph_patches(nikon_d5100(), chart_140()[:60], styles=STYLES, balances=balances, stops=(-2, -1, 0))
    return spread_over_picture(patches)


def test_matrix_and_response_are_fitted_once_for_each_style(fits: list[int]) -> None:
    calibrate(_shots(), CalibrationOptions(size=5))
    assert len(fits) == len(STYLES)


def test_they_are_fitted_again_where_a_step_changes_the_samples(fits: list[int]) -> None:
    samples = _shots()
    names = [name for name in np.unique(samples.shot) if name.startswith("vivid")]
    calibrate(with_gamma(samples, names[:1], 0.85), CalibrationOptions(size=5))
    assert len(fits) == len(STYLES) + 1  # a shot of one style is left out


def test_a_round_of_gains_is_a_fit_of_each_style(fits: list[int]) -> None:
    samples = _shots()
    brighter = replace(samples, raw=np.where(samples.white_balance[:, None] == "shade", 0.9, 1.0) * samples.raw)
    profile, _ = calibrate(brighter, CalibrationOptions(size=5))
    assert profile.white_balances["shade"].gain != 1.0
    assert len(STYLES) < len(fits) <= len(STYLES) * (1 + steps.GAIN_ROUNDS)


def test_vignetting_is_corrected_before_they_are_fitted(fits: list[int]) -> None:
    samples = _shots()
    calibrate(with_dark_corners(samples, lost_stops(samples, 0.8)), CalibrationOptions(size=5))
    assert len(fits) == len(STYLES)
