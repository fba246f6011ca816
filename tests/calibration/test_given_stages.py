"""Stages that were fitted by themselves: what gamut map and lattice are then fitted with, and what a profile holds."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions, PhysicalOptions, Preset, options_from_json
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate, calibrate_stages
from lutforge.samples.sample_set import SampleSet
from tests.studio.shots_for_the_studio import chart_samples


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    return chart_samples(patches=45)


@pytest.mark.slow
def test_a_lattice_follows_given_stages_where_it_has_no_samples(samples: SampleSet) -> None:
    """A response of half the light, given, moves the lattice; on the samples themselves it stays."""
    options = CalibrationOptions(size=5)
    dark = samples.select(samples.srgb.max(axis=1) < 0.55)
    stages, whole = calibrate_stages(dark, options), calibrate_stages(samples, options)
    profiles = [calibrate(dark, options, stages=given) for given in (stages, whole)]
    assert "response and matrix were given" in " ".join(profiles[0].notes)
    one, other = (profile.render("standard/daylight") for profile in profiles)
    assert not np.array_equal(one(np.full((1, 3), 0.5)), other(np.full((1, 3), 0.5)))
    shown = dark.select((dark.style == "standard") & (dark.white_balance == "daylight"))
    assert np.abs(one(shown.raw) - other(shown.raw)).mean() < 0.005


def test_a_camera_without_raw_takes_given_stages(samples: SampleSet) -> None:
    other = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    stages = calibrate_stages(other, CalibrationOptions())
    models = stages.styles["standard"].physical
    assert len(models) == 1 and len(models[0].gamut_map.centres) == 1  # which changes nothing
    options = CalibrationOptions(size=5, model="rbf", physical=PhysicalOptions(centres=50))
    profile = calibrate(other, options, stages=stages)
    for before, after in zip(models, profile.styles["standard"].physical, strict=True):
        np.testing.assert_array_equal(before.matrix, after.matrix)
        assert 8 <= len(after.gamut_map.centres) <= 50


@pytest.mark.slow
def test_options_act_or_are_refused(samples: SampleSet) -> None:
    def with_options(preset: Preset = "lutforge", **physical: Any) -> CameraProfile:
        return calibrate(samples, CalibrationOptions(preset=preset, size=5, physical=PhysicalOptions(**physical)))

    usual = with_options().matrix
    for acting in ({"beta": 0.9}, {"weighting": 1.0}, {"curves": 2}):
        assert not np.array_equal(with_options(**acting).matrix, usual), acting
    with pytest.raises(CalibrationError, match="leave rho out"):
        with_options(rho=1e-6)
    with pytest.raises(CalibrationError, match="leave weighting out"):
        with_options("thesis", weighting=1.0)


def test_options_of_the_stages_come_back_from_a_profile() -> None:
    physical = PhysicalOptions(beta=0.2, curves=5, rho=1e-6, without_pairs=(("a", "b"),))
    options = CalibrationOptions(physical=physical)
    assert options_from_json(options.as_json()).physical == physical
    assert "physical" not in CalibrationOptions().as_json()
    for name, wrong in (
        ("beta", 0.0),
        ("curves", 0),
        ("weighting", 2.0),
        ("centres", 1),
        ("rho", -1.0),
        ("rho", np.inf),
    ):
        with pytest.raises(CalibrationError):
            PhysicalOptions(**{name: wrong})  # type: ignore[arg-type]  # options by name


def test_pairs_that_are_left_out_do_not_tell_the_response(samples: SampleSet) -> None:
    standard = samples.select((samples.style == "standard") & (samples.white_balance == "daylight"))
    options = CalibrationOptions(preset="thesis", model="rbf")
    dark, middle, bright = (f"shot standard daylight {stops}" for stops in ("-2.5", "-1.5", "-0.5"))
    fewer = replace(options, physical=PhysicalOptions(without_pairs=((middle, dark), (dark, bright))))
    curves = [
        calibrate_stages(standard, each).styles["standard"].physical[0].response.inverse for each in (options, fewer)
    ]
    assert not np.array_equal(curves[0], curves[1])
    everything = tuple((one, other) for one in (dark, middle, bright) for other in (dark, middle, bright))
    with pytest.raises(CalibrationError):
        calibrate_stages(standard, replace(options, physical=PhysicalOptions(without_pairs=everything)))
