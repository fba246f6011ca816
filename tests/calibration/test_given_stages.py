"""Stages that were fitted by themselves: what gamut map and lattice are then fitted with, and what a profile holds."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import CalibrationError
from lutforge.pipeline.calibration import calibrate, calibrate_base
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.options import Options, ThesisOptions, stated_options
from tests.studio.shots_for_the_studio import chart_samples


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    return chart_samples(patches=45)


@pytest.mark.slow
def test_a_lattice_follows_given_stages_where_it_has_no_samples(samples: SampleSet) -> None:
    """A response of half the light, given, moves the lattice; on the samples themselves it stays."""
    options = CalibrationOptions(size=5)
    dark = samples.select(samples.srgb.max(axis=1) < 0.55)
    stages, whole = calibrate_base(dark, options), calibrate_base(samples, options)
    profiles = [calibrate(dark, options, given=given) for given in (stages, whole)]
    assert "response and matrix were given" in " ".join(profiles[0].notes)
    first, second = (profile.render("standard/daylight") for profile in profiles)
    assert not np.array_equal(first(np.full((1, 3), 0.5)), second(np.full((1, 3), 0.5)))
    shown = dark.select((dark.style == "standard") & (dark.white_balance == "daylight"))
    assert np.abs(first(shown.raw) - second(shown.raw)).mean() < 0.005


def test_a_camera_without_raw_takes_given_stages(samples: SampleSet) -> None:
    other = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    stages = calibrate_base(other, CalibrationOptions())
    models = stages.styles["standard"].models
    assert len(models) == 1 and len(models[0].gamut_map.centres) == 1  # which changes nothing
    options = CalibrationOptions(size=5, centres=50)
    profile = calibrate(other, options, given=stages)
    for before, after in zip(models, profile.styles["standard"].models, strict=True):
        np.testing.assert_array_equal(before.matrix, after.matrix)
        assert 8 <= len(after.gamut_map.centres) <= 50


@pytest.mark.slow
def test_options_act(samples: SampleSet) -> None:
    usual = calibrate(samples, CalibrationOptions(size=5)).matrix
    for acting in (CalibrationOptions(size=5, beta=0.9), CalibrationOptions(size=5, curves=2)):
        assert not np.array_equal(calibrate(samples, acting).matrix, usual), acting


@pytest.mark.parametrize(
    "options",
    [
        CalibrationOptions(),
        CalibrationOptions(size=9, beta=0.2, curves=5, centres=100, nonuniform=False),
        ThesisOptions(),
        ThesisOptions(size=9, beta=0.2, curves=5, rho=1e-6, without_pairs=(("a", "b"),)),
    ],
)
def test_options_come_back_from_a_profile(options: Options) -> None:
    assert stated_options(json.loads(json.dumps(options.as_json()))) == options


@pytest.mark.parametrize(
    ("options", "name", "wrong"),
    [
        (CalibrationOptions, "beta", 0.0),
        (CalibrationOptions, "curves", 0),
        (CalibrationOptions, "centres", 1),
        (CalibrationOptions, "size", 66),
        (ThesisOptions, "rho", -1.0),
        (ThesisOptions, "rho", np.inf),
        (ThesisOptions, "beta", 1.5),
    ],
)
def test_options_without_meaning_are_refused(options: Any, name: str, wrong: float) -> None:
    with pytest.raises(CalibrationError):
        options(**{name: wrong})


def test_pairs_that_are_left_out_do_not_tell_the_response(samples: SampleSet) -> None:
    standard = samples.select((samples.style == "standard") & (samples.white_balance == "daylight"))
    options = ThesisOptions()
    dark, middle, bright = (f"shot standard daylight {stops}" for stops in ("-2.5", "-1.5", "-0.5"))
    fewer = replace(options, without_pairs=((middle, dark), (dark, bright)))
    curves = [calibrate_base(standard, each).styles["standard"].models[0].response.inverse for each in (options, fewer)]
    assert not np.array_equal(curves[0], curves[1])
    everything = tuple((first, second) for first in (dark, middle, bright) for second in (dark, middle, bright))
    with pytest.raises(CalibrationError):
        calibrate_base(standard, replace(options, without_pairs=everything))
