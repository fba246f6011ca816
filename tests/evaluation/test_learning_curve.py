"""The learning curve on a simulated camera: the error falls as shots are added, and the advice says so."""

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style_data import StyleData
from lutforge.errors import CalibrationError
from lutforge.evaluation.learning_curve import learning_curve
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100

CAMERA = nikon_d5100()
GAIN = CAMERA.multipliers("daylight")


def shots(count: int, colours: int) -> StyleData:
    """Shots of few colours each, that lie close together as those of one scene do."""
    rng = np.random.default_rng(0)
    middle = rng.uniform(0.1, 0.6, (count, 1, 3))
    x = np.clip(middle * rng.uniform(0.3, 1.4, (count, colours, 3)), 0.005, 0.9).reshape(-1, 3)
    y = np.asarray(CAMERA.render(x / GAIN, "standard", "daylight"))
    inside = np.all((y > 0.002) & (y < 0.998), axis=1)
    shot = np.repeat([f"shot {n}" for n in range(count)], colours)[inside]
    text = np.full(len(shot), "daylight")
    samples = SampleSet(
        np.full(len(shot), "Camera"),
        np.full(len(shot), "standard"),
        text,
        shot,
        np.arange(len(shot)).astype(str),
        np.full(len(shot), np.nan),
        x[inside] / GAIN,
        y[inside],
        np.tile(GAIN, (len(shot), 1)),
        np.full(len(shot), "Camera"),
    )
    return StyleData(x[inside], y[inside], shot, samples)


def test_more_shots_make_less_error() -> None:
    told: list[float] = []
    curve = learning_curve(shots(9, 60), CalibrationOptions(size=9), lambda what, share: told.append(share))
    assert [point.shots for point in curve.points] == [1, 2, 4, 6]
    assert curve.points[-1].render < 0.6 * curve.points[0].render
    assert curve.points[-1].linearize < curve.points[0].linearize
    assert np.all(np.diff([point.samples for point in curve.points]) > 0)
    assert "shots" in curve.advice
    assert told[-1] == 1.0


def test_two_points_are_no_trend() -> None:
    """Three shots give fits to one and to two."""
    curve = learning_curve(shots(3, 60), CalibrationOptions(size=5))
    assert len(curve.points) == 2
    assert "enough" not in curve.advice and "add shots" in curve.advice


def test_a_visible_error_is_never_enough() -> None:
    """Noise of the JPEG that no number of shots takes away: the error stays, and is seen."""
    data = shots(9, 60)
    noisy = np.clip(data.encoded + np.random.default_rng(3).normal(0, 0.06, data.encoded.shape), 0, 1)
    curve = learning_curve(StyleData(data.balanced, noisy, data.shot, data.samples), CalibrationOptions(size=5))
    assert curve.points[-1].de00 > 1
    assert "enough" not in curve.advice


def test_two_shots_are_too_few() -> None:
    with pytest.raises(CalibrationError, match="2 shots"):
        learning_curve(shots(2, 60))
