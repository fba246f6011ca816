"""Brightness transfer functions of the simulated camera: outliers where the gamut map changes colours."""

from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.brightness_transfer import TransferFunction, transfer_functions
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.response_verdict import judge
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import chart_140, photograph_patches

CAMERA = nikon_d5100()
SAMPLES, VIVID_SAMPLES = (
    photograph_patches(CAMERA, chart_140(), styles=(style,), balances=balances, stops=(-3, -2, -1, 0))
    for style, balances in (("standard", ("daylight", "tungsten")), ("vivid", ("daylight",)))
)
PAIRS, VIVID = pairs_of_samples(SAMPLES), pairs_of_samples(VIVID_SAMPLES)


def off(one: TransferFunction, curve: np.ndarray, style: str) -> np.ndarray:
    """How far a curve of a function is from the camera's, in the middle tones (100, 3)."""
    codes, true = np.linspace(0.1, 0.7, 100), CAMERA.styles[style][1]
    expected = true(2.0**one.stops * true.inverse(np.stack([codes] * 3, axis=1)))
    at = np.stack([np.interp(codes, np.linspace(0, 1, 256), curve[:, c]) for c in range(3)], axis=1)
    return np.asarray(np.abs(at - expected))


def test_one_function_a_ratio_and_it_is_the_cameras() -> None:
    functions = transfer_functions(PAIRS)
    assert [round(function.stops) for function in functions] == sorted(round(f.stops) for f in functions)
    one = min(functions, key=lambda function: abs(function.stops - 1.0))
    assert off(one, one.curve, "standard").max() < 0.006
    assert len(one.first) == len(one.outlier)
    assert np.nanmedian(one.raw_second / one.raw_first) == pytest.approx(2.0**one.stops, rel=0.05)


def test_removing_outliers_brings_the_function_nearer_to_the_cameras() -> None:
    """The thesis's Fig. 4.2, where the gamut map moves much."""
    one = min(transfer_functions(VIVID), key=lambda function: abs(function.stops - 1.0))
    assert off(one, one.curve, "vivid").mean() < 0.7 * off(one, one.curve_with_outliers, "vivid").mean()


def test_outliers_are_the_saturated_colours_and_the_response_is_fixed() -> None:
    assert judge(PAIRS).fixed
    verdict = judge(VIVID)
    assert verdict.fixed
    assert verdict.outlier_saturation > verdict.inlier_saturation + 0.1
    assert 0.0 < verdict.outliers < 0.3
    assert verdict.raw_spread < 0.02


def test_a_camera_that_renders_each_light_differently_is_found_out() -> None:
    second = SAMPLES.shot == "standard tungsten -1"
    changed = replace(SAMPLES, srgb=np.where(second[:, None], SAMPLES.srgb**0.8, SAMPLES.srgb))
    assert not judge(pairs_of_samples(changed)).fixed
