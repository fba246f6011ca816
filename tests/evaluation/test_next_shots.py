"""What to photograph next: colours that a style knows have at most half the error of those that it asks for."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import lutforge as lf
from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000
from lutforge.evaluation.expected_difference import expected_difference
from lutforge.evaluation.next_shots import KnownColours, known_colours, real_surfaces, region_names
from lutforge.samples.sample_set import concatenate
from lutforge.simulate.camera import SimulatedCamera, nikon_d5100, sigma_sd_merrill
from tests.cases.profiles import plain_profile
from tests.cases.real_data import S40
from tests.cases.samples import chart_140, photograph_patches, surfaces

SMALL = lf.CalibrationOptions(size=5)
HUES = ("pink", "red", "orange", "yellow", "green", "cyan", "blue", "purple")


def known(profile: lf.CameraProfile, samples: lf.SampleSet, style: str = "standard") -> KnownColours:
    return known_colours(profile, style, samples.srgb)


def one_chart(camera: SimulatedCamera, times: int) -> lf.SampleSet:
    """Photographs of one chart in one light at one exposure."""
    taken = [
        photograph_patches(camera, chart_140()[:24], balances=("daylight",), stops=(0,), seed=seed, exposure_error=0.0)
        for seed in range(times)
    ]
    return concatenate([replace(part, shot=np.full(len(part), f"shot {n}")) for n, part in enumerate(taken)])


def ratio_of_errors(camera: SimulatedCamera, samples: lf.SampleSet, style: str) -> float:
    """The true mean ΔE00 of colours that count as known, over that of those asked for: other surfaces and exposures."""
    profile = lf.calibrate(samples, SMALL)
    model = profile.styles[style].models[0]
    expects = expected_difference(model)
    assert expects is not None
    asked_for, errors = [], []
    stated = known_colours(profile, style, samples.select(samples.style == style).srgb)
    for seed, light in enumerate(("daylight", "tungsten")):
        rng = np.random.default_rng([seed, 5])
        levels = np.exp(rng.uniform(-3.0, 0.4, (800, 1)))
        raw = np.clip(levels * camera.expose(surfaces(800, 77 + seed), light), 0.0, 1.0)
        linear = np.minimum(raw * profile.multipliers(f"{style}/daylight"), 1.0) @ model.matrix.T
        made = np.clip(profile.render(f"{style}/daylight", model="model")(raw), 0.0, 1.0)
        errors.append(delta_e_2000(made, camera.render(raw, style, "daylight")))
        asked_for.append(stated.asks_for(expects(linear)))
    asked, error = np.concatenate(asked_for), np.concatenate(errors)
    assert 0.001 < asked.mean() < 0.5
    return float(error[~asked].mean() / error[asked].mean())


@pytest.mark.parametrize("camera", [nikon_d5100(), sigma_sd_merrill()], ids=["D5100", "Merrill"])
@pytest.mark.parametrize("stops", [(0,), (-3, -1, 1)], ids=["one exposure", "three"])
def test_known_colours_have_half_the_error_of_those_asked_for(camera: SimulatedCamera, stops: Sequence[float]) -> None:
    samples = photograph_patches(camera, chart_140(), balances=("daylight",), stops=stops, styles=("standard",))
    assert ratio_of_errors(camera, samples, "standard") < 0.5


@pytest.mark.parametrize("times", [1, 3])
def test_one_chart_in_one_light_is_never_enough(times: int) -> None:
    chart = one_chart(nikon_d5100(), times)
    found = known(lf.calibrate(chart, SMALL), chart)
    assert not found.are_vouched_for and "no error is proven" in found.advice
    assert len(found.gaps) >= 3
    assert all(gap.difference > found.usual for gap in found.gaps)


@pytest.mark.parametrize("stops", [(-0.5, 0, 0.5), (-4, -3, -2, -1, 0)])
def test_one_chart_is_not_enough_where_its_own_exposures_were_held_out(stops: Sequence[float]) -> None:
    """However small the errors are that its shots predict of each other, other colours have not been seen."""
    chart = photograph_patches(nikon_d5100(), chart_140()[:24], balances=("daylight",), stops=stops)
    found = known(lf.calibrate(chart, SMALL), chart)
    assert found.is_measured and not found.are_vouched_for
    assert "of the colours that real surfaces have are near a sample" in found.advice and found.gaps


def test_five_photographs_of_a_camera_are_not_asked_for_all_hues() -> None:
    samples = lf.read_samples(S40)
    found = known(lf.calibrate(samples, SMALL), samples)
    assert found.are_vouched_for
    assert len({hue for hue in HUES for gap in found.gaps if hue in gap.colour}) < 4
    one = samples.select(samples.shot == samples.shot[0])
    alone = known(lf.calibrate(one, SMALL), one)
    assert len(alone.gaps) >= 3 and alone.usual > 1.2 * found.usual


def test_where_nothing_must_be_shot_the_least_known_colours_are_named() -> None:
    wall = photograph_patches(nikon_d5100(), chart_140(), balances=("daylight", "tungsten"), stops=(-3, -1, 0, 1))
    found = known(lf.calibrate(wall, SMALL), wall)
    assert found.gaps == () and found.are_vouched_for
    assert found.advice.startswith("nothing that must be shot") and "enough" not in found.advice
    assert found.least_known and found.least_known[0].colour in found.advice


def test_colours_without_a_sample_nearby_are_named_where_no_error_can_be_expected() -> None:
    """As of profiles without a kriged gamut map."""
    profile = plain_profile("A camera")
    everything = np.random.default_rng(1).random((60_000, 3))
    assert known_colours(profile, "standard", everything).least_known == ()
    without_blues = everything[everything[:, 2] < everything[:, 0] * 0.9 + 0.05]
    gaps = known_colours(profile, "standard", without_blues).gaps
    assert any("blue" in gap.colour and "have no sample nearby" in str(gap) for gap in gaps)
    assert not any("red" in gap.colour or "yellow" in gap.colour for gap in gaps)
    assert known_colours(profile, "standard", np.zeros((0, 3))).gaps


def test_real_surfaces_have_all_hues_and_tones() -> None:
    linear = real_surfaces()
    inside: Array = np.clip(linear, 0.0, 1.0)
    names = " ".join(np.unique(region_names(np.sqrt(inside))))
    assert all(hue in names for hue in (*HUES, "grey"))
    assert all(tone in names for tone in ("very dark", "dark", "medium", "light", "very light"))
