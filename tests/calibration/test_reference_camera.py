"""A camera without RAW, calibrated through another camera's RAW of the same surfaces."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.calibrate import prepared
from lutforge.calibration.curve_basis import gamma_response
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.raw_transfer import fit_raw_transfer, pair_samples
from lutforge.calibration.reference_camera import own_raw
from lutforge.colour.saturation import saturation
from lutforge.colour.spectra import chart_reflectances, surface_reflectances
from lutforge.colour.srgb import srgb_to_lab
from lutforge.errors import CalibrationError, ProfileError
from lutforge.evaluation.evaluation import evaluate
from lutforge.evaluation.methods import CAMERA_MODEL
from lutforge.model.camera_profile import match
from lutforge.model.raw_transfer import RawTransfer
from lutforge.model.response_profile import profile_of_response
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.scene import palette
from lutforge.thesis.options import ThesisOptions
from lutforge.thesis.reference_camera import own_raw as own_raw_of_thesis
from tests.cases.samples import chart_140, photograph_patches, surfaces

OWN, REFERENCE = sigma_sd_merrill(), nikon_d5100()
BALANCES = ("tungsten", "daylight", "shade")


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    """JPEG values of one camera beside the RAW of another, shot by shot under the same light."""
    own = photograph_patches(OWN, chart_140(), balances=BALANCES, stops=(-3, -2, -1, 0))
    reference = photograph_patches(REFERENCE, chart_140(), balances=BALANCES, stops=(-3, -2, -1, 0), seed=1)
    return replace(own, raw=reference.raw, raw_camera=reference.camera, wb=np.full_like(own.wb, np.nan))


@pytest.mark.slow
def test_refinishing_works_and_the_own_raw_is_refused(samples: SampleSet) -> None:
    profile = calibrate(samples, CalibrationOptions())
    assert profile.raw_camera == REFERENCE.name
    with pytest.raises(ProfileError, match="has no RAW"):
        profile.linearize("standard/daylight")
    raw = OWN.expose(surfaces(300, 4), "daylight") * 0.5
    before, expected = OWN.render(raw, "standard", "tungsten"), OWN.render(raw, "standard", "daylight")
    seen = np.all((before > 0.03) & (before < 0.97) & (expected > 0.03) & (expected < 0.97), axis=1)
    after = profile.refinish("standard/tungsten", "standard/daylight")(before)
    plain = np.sqrt(np.mean((before[seen] - expected[seen]) ** 2))
    error = np.sqrt(np.mean((after[seen] - expected[seen]) ** 2))
    assert error < 0.04  # the thesis reaches 0.02 with the camera's own RAW; the sensors differ by more than a matrix
    assert error < 0.3 * plain
    rows = [row for row in evaluate(profile, samples).rows if row.method == CAMERA_MODEL and row.shot == "all"]
    assert {row.direction for row in rows} == {"render", "linearize"}
    assert all(row.figures.mean < 0.03 for row in rows)


@pytest.mark.slow
def test_a_dial_that_is_wrong_for_the_light_needs_nothing_neutral() -> None:
    """All white balances in one light: what is neutral under one of them tells the light, one Tc serves them all."""
    raws = {name: camera.expose(surfaces(400, 5), "daylight") for name, camera in (("own", OWN), ("ref", REFERENCE))}
    parts = []
    for balance in ("daylight", "tungsten", "shade"):
        for stop in (-2, -1, 0):
            encoded = np.rint(255 * OWN.render(raws["own"] * 2.0**stop, "standard", balance)) / 255
            shot, raw = f"{balance}{stop}", 0.8 * raws["ref"] * 2.0**stop
            taken = SampleSet.from_arrays(
                raw, encoded, camera=OWN.name, white_balance=balance, shot=shot,
                patch=np.arange(len(raw)).astype(np.str_), exposure_s=2.0**stop,
            )  # fmt: skip
            parts.append(replace(taken, raw_camera=np.full(len(raw), REFERENCE.name)))
    carried, _ = own_raw(concatenate(parts))
    for balance in ("tungsten", "shade"):
        found, expected = (
            np.median(carried.wb[carried.white_balance == balance], axis=0)
            / np.median(carried.wb[carried.white_balance == "daylight"], axis=0),
            OWN.multipliers(balance) / OWN.multipliers("daylight"),
        )
        np.testing.assert_allclose(found, expected, rtol=0.12)  # the sensors differ by more than a matrix
    profile = calibrate(concatenate(parts), CalibrationOptions(size=13))
    before, expected = (OWN.render(0.4 * raws["own"], "standard", balance) for balance in ("tungsten", "daylight"))
    seen = np.all((before > 0.03) & (before < 0.97) & (expected > 0.03) & (expected < 0.97), axis=1)
    after = profile.refinish("standard/tungsten", "standard/daylight")(before)
    assert np.sqrt(np.mean((after[seen] - expected[seen]) ** 2)) < 0.02


def test_shots_that_are_too_dark_do_not_bend_the_response(samples: SampleSet) -> None:
    """Fitted before the gains, f would take a part of what all shots of some tones have too little RAW by."""

    def log_gains(set_: SampleSet) -> dict[str, float]:
        carried, transfer = own_raw(set_)
        inside = set_.select(unclipped_colours(set_.srgb, set_.raw))
        ratio = np.log(carried.raw.sum(axis=1) / (inside.raw @ transfer.T).sum(axis=1))
        return {str(shot): float(np.median(ratio[inside.shot == shot])) for shot in np.unique(inside.shot)}

    dark = np.char.endswith(samples.shot, "-1")
    before, after = (
        log_gains(replace(samples, raw=np.where(dark[:, None], factor * samples.raw, samples.raw)))
        for factor in (1.0, 0.8)
    )
    for balance in BALANCES:
        change = {stop: after[name] - before[name] for name in before if balance in name for stop in [name[-2:]]}
        found = np.exp(change.pop("-1") - np.mean(list(change.values())))
        assert found == pytest.approx(1 / 0.8, abs=0.015)


def test_the_thesis_trusts_unsaturated_colours_alike_and_the_exposures(samples: SampleSet) -> None:
    """As (4.10) has it: no shot gets a gain, and colours above the saturation β tell nothing."""
    dark = np.char.endswith(samples.shot, "-1")
    spoilt = replace(samples, raw=np.where(dark[:, None], 0.8 * samples.raw, samples.raw))
    carried, transfer = own_raw_of_thesis(spoilt, ThesisOptions())
    inside = spoilt.select(unclipped_colours(spoilt.srgb, spoilt.raw))
    np.testing.assert_allclose(carried.raw, inside.raw @ transfer.T)
    low = saturation(spoilt.srgb) < 0.7  # where greys are all that lies below β = 0.3, the limit is raised to that
    recoloured = replace(spoilt, raw=np.where(low[:, None], spoilt.raw, 0.9 * spoilt.raw[:, ::-1]))
    scale = own_raw_of_thesis(recoloured, ThesisOptions())[1] / transfer
    np.testing.assert_allclose(scale, scale[0, 0], rtol=1e-6)


def test_the_number_of_curves_is_also_that_of_a_camera_without_raw(samples: SampleSet) -> None:
    standard = samples.select(samples.style == "standard")
    found = prepared(standard, CalibrationOptions(curves=2)).samples
    np.testing.assert_array_equal(found.raw, own_raw(standard, curves=2)[0].raw)
    assert np.abs(found.raw - own_raw(standard)[0].raw).max() > 1e-4


@pytest.mark.slow
def test_samples_of_another_raw_are_no_measure_of_a_profile(samples: SampleSet) -> None:
    profile = calibrate(samples.select(samples.style == "standard"), CalibrationOptions(size=9))
    own = photograph_patches(OWN, chart_140(), balances=("daylight",), stops=(-1,))
    with pytest.raises(CalibrationError, match="sample what the profile is of"):
        evaluate(profile, own)
    response = profile_of_response(gamma_response(2.2), OWN.name, "standard", "daylight")
    with pytest.raises(CalibrationError, match="holds a response alone"):
        evaluate(response, own)


@pytest.mark.slow
def test_bright_greys_are_not_cut_at_the_references_saturation(samples: SampleSet) -> None:
    """A camera that exposes brighter than its reference reaches its white beyond the reference's 1."""
    rows = samples.raw.max(axis=1) > 0  # a reference that is four times as sensitive clips most bright colours
    sensitive = replace(samples, raw=np.minimum(4.0 * samples.raw, 1.0)).select(rows)
    profile = calibrate(sensitive, CalibrationOptions())
    greys = np.repeat(np.array([[180.0], [210.0], [230.0], [245.0]]) / 255.0, 3, axis=1)
    back = profile.refinish("standard/daylight", "standard/daylight", ev=1e-6)(greys)  # else it is the identity
    assert np.all(np.diff(back, axis=0) > 0.02)


def test_shots_that_do_not_belong_together_are_refused(samples: SampleSet) -> None:
    rng = np.random.default_rng(0)
    mixed = replace(samples, raw=samples.raw[rng.permutation(len(samples))])
    with pytest.raises(CalibrationError, match="same scene"):
        calibrate(mixed, CalibrationOptions())


A, B = nikon_d5100(), sigma_sd_merrill()


def fit(light: str, noise: float = 0.0) -> RawTransfer:
    surfaces, rng = np.vstack([chart_reflectances(), surface_reflectances()]), np.random.default_rng(0)
    x, y = (camera.expose(surfaces, light) + rng.normal(0, noise, (len(surfaces), 3)) for camera in (A, B))
    return fit_raw_transfer(A.name, B.name, x, y, 1 / A.multipliers(light))


def rendered_error(light: str, raw: NDArray[np.float64], truth: NDArray[np.float64]) -> float:
    got, expected = (B.render(values, "standard", light) for values in (raw, truth))
    inside = np.all((expected > 0.004) & (expected < 0.996), axis=1)
    return float(np.sqrt(np.mean((got - expected)[inside] ** 2)))


def test_other_colours_come_out_as_the_other_camera_sees_them() -> None:
    """Nearer than by the cameras' own matrices, under every light."""
    unseen = palette(600, np.random.default_rng(9))
    for light in A.white_balances:
        x, y = A.expose(unseen, light), B.expose(unseen, light)
        matrices = (x * A.multipliers(light)) @ A.matrix.T @ np.linalg.inv(B.matrix).T / B.multipliers(light)
        error = rendered_error(light, fit(light)(x), y)
        assert error <= 0.022
        assert rendered_error(light, fit(light, noise=0.002)(x), y) <= 0.023
        assert error < 0.97 * rendered_error(light, matrices, y)


def test_a_root_polynomial_is_nearer_than_the_best_matrix() -> None:
    """By a tenth and more, on colours that were not fitted, under every light."""
    unseen = palette(600, np.random.default_rng(9))
    for light in A.white_balances:
        x, y = A.expose(unseen, light), B.expose(unseen, light)
        transfer = fit(light)
        assert transfer.roots.any()
        surfaces = np.vstack([chart_reflectances(), surface_reflectances()])
        best = np.linalg.lstsq(A.expose(surfaces, light), B.expose(surfaces, light), rcond=None)[0]
        assert rendered_error(light, transfer(x), y) < 0.9 * rendered_error(light, x @ best, y)


@pytest.mark.slow
def test_a_match_keeps_greys_on_one_line() -> None:
    """Both cameras' greys are neutral: none is tinted by half a step that the eye sees, nor unlike another."""
    lights = ("daylight", "tungsten")
    samples = [photograph_patches(each, chart_140()[:48], balances=lights, stops=(-3, -2, -1, 0)) for each in (A, B)]
    profiles = [calibrate(each, CalibrationOptions()) for each in samples]
    greys = np.linspace(0.08, 0.97, 90)[:, None] * np.ones(3)
    for source, target in (profiles, profiles[::-1]):
        for setting in ("standard/daylight", "standard/tungsten"):
            tint = srgb_to_lab(match(source, setting, target, setting)(greys))[:, 1:]
            assert np.abs(tint).max() <= 0.5, (target.camera, setting)
            assert np.ptp(tint, axis=0).max() <= 0.5, (target.camera, setting)


def test_a_fit_is_carried_over_to_other_lights() -> None:
    unseen = palette(600, np.random.default_rng(9))
    transfer = fit("daylight")
    x, y = A.expose(unseen, "tungsten"), B.expose(unseen, "tungsten")
    carried = transfer.under(A.multipliers("tungsten"), B.multipliers("tungsten"))(x)
    assert rendered_error("tungsten", carried, y) < 0.75 * rendered_error("tungsten", transfer(x), y)


def test_a_linear_relation_is_found_whatever_the_noise_free_colours() -> None:
    rng = np.random.default_rng(4)
    matrix = np.array([[0.9, 0.1, 0.0], [0.05, 1.1, -0.1], [0.0, 0.1, 0.8]])
    x = rng.uniform(0.05, 0.9, (60, 3))
    transfer = fit_raw_transfer("a", "b", x, x @ matrix.T, np.array([0.5, 1.0, 0.6]))
    np.testing.assert_allclose(transfer(x), x @ matrix.T, atol=1e-6)
    assert transfer.error is not None and transfer.error < 1e-6


def test_patches_pair_by_name_and_shots_by_name_or_order() -> None:
    first = photograph_patches(A, chart_140(), balances=("daylight",), stops=(-2, -1))
    second = replace(first, camera=np.full(len(first), B.name), raw=0.5 * first.raw)
    x, y, neutral = pair_samples(first, second)
    np.testing.assert_allclose(y, 0.5 * x)
    assert neutral[1] == pytest.approx(1.0)
    renamed = replace(second, shot=np.char.add("other ", second.shot))
    np.testing.assert_array_equal(pair_samples(first, renamed)[1], y)
    with pytest.raises(CalibrationError, match="common to both"):
        pair_samples(first, replace(renamed, patch=np.char.add("p", second.patch)))


def test_colours_that_do_not_determine_it_are_refused() -> None:
    grey = np.linspace(0.1, 0.9, 20)[:, None] * np.ones(3)
    with pytest.raises(CalibrationError, match="all alike"):
        fit_raw_transfer("a", "b", grey, grey, np.ones(3))
    with pytest.raises(CalibrationError, match="at least"):
        fit_raw_transfer("a", "b", grey[:3], grey[:3], np.ones(3))
