"""Photographs of a real camera."""

import lutforge as lf
from lutforge.samples.sample_set import SampleSet


def test_each_shot_left_out_is_predicted_within_six_codes(s40_samples: SampleSet) -> None:
    """Mean RGB error of the held-out shot; matrix and response alone leave 0.040, polynomials 0.080."""
    profile = lf.calibrate(s40_samples, lf.CalibrationOptions(size=17))
    rows = [row for row in lf.evaluate(profile, s40_samples).rows if row.direction == "render"]
    shots = [row for row in rows if row.method == "camera model" and row.shot != "all"]
    assert len(shots) == 5 and all(row.held_out for row in shots)
    assert all(row.figures.mean < 6 / 255 for row in shots)
    mean = {row.method: row.figures.mean for row in rows if row.shot == "all"}
    assert mean["camera model"] < 0.5 * mean["matrix and response"] < 0.5 * mean["polynomial per channel"]
