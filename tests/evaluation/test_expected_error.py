"""The expected error: from held-out samples, at the nodes of a profile, and in the file."""

from pathlib import Path

import numpy as np
import pytest

import lutforge as lf
from lutforge.evaluation.expected_error import HeldOut
from lutforge.interpolation import interpolate
from lutforge.simulate.camera import nikon_d5100
from tests.cases.spoilt_samples import simulated


@pytest.fixture(scope="module")
def expecting() -> lf.CameraProfile:
    return lf.calibrate(simulated(nikon_d5100(), seed=3, shots=6), lf.CalibrationOptions(size=9))


def test_coefficients_are_those_of_the_errors() -> None:
    rng = np.random.default_rng(0)
    deviation = 0.3 * rng.random(400) + 0.01
    held_out = HeldOut(deviation, 0.002 + 0.3 * deviation)
    np.testing.assert_allclose(held_out.coefficients(), [0.002, 0.3], atol=1e-9)


def test_a_profile_expects_more_error_away_from_its_samples(expecting: lf.CameraProfile) -> None:
    style = expecting.styles["standard"]
    assert set(style.expected) == {"render", "linearize"}
    assert all(style.errors[f"linearize_{name}"] >= 0 for name in ("at_sample", "per_deviation"))
    assert style.linearize is not None
    values = np.repeat(style.expected["linearize"][..., None], 3, axis=-1)
    grey, pure = np.full((1, 3), 0.4), np.clip(np.eye(3), 0.02, 0.98)
    of_grey, of_pure = (interpolate(colours, style.linearize.levels, values, "trilinear") for colours in (grey, pure))
    assert of_pure.mean() > 3 * of_grey.mean()


def test_expected_errors_survive_the_file(expecting: lf.CameraProfile, tmp_path: Path) -> None:
    expecting.save(tmp_path / "camera.npz")
    again = lf.load_profile(tmp_path / "camera.npz").styles["standard"].expected
    for direction, values in expecting.styles["standard"].expected.items():
        np.testing.assert_allclose(again[direction], values, atol=1e-5)
