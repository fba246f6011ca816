"""The thesis's tables on a simulated camera: held out by shot, against figures computed by hand, and as JSON."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.calibration.style import unclipped
from lutforge.evaluation import evaluation as evaluation_module
from lutforge.evaluation.evaluation import Evaluation, evaluate
from lutforge.evaluation.linearization_errors import delta
from lutforge.evaluation.polynomials import channel_polynomials
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.simulate.camera import nikon_d5100
from lutforge.thesis.options import ThesisOptions
from tests.cases.samples import chart_140, photograph_patches

CAMERA = nikon_d5100()
BASELINES = ("f and T, no h", "polynomial per channel", "polynomial of all channels")
SIZES = (4, 5)


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    """One chart: two styles, two lights, two exposures; the RAW of the two styles is that of one scene."""
    chart = chart_140()[:60]
    standard = photograph_patches(CAMERA, chart, balances=("tungsten", "daylight"), stops=(-1, 0), exposure_error=0.02)
    vivid = photograph_patches(CAMERA, chart, styles=("vivid",), balances=("daylight",), stops=(-1, -0.5, 0))
    return concatenate([standard, vivid])


@pytest.fixture(scope="module")
def profile(samples: SampleSet) -> CameraProfile:
    return calibrate(samples, CalibrationOptions(size=5, nonuniform=False))


@pytest.fixture(scope="module")
def tables(profile: CameraProfile, samples: SampleSet) -> Evaluation:
    """All methods, of one of the styles."""
    return evaluate(profile, samples.select(samples.style == "standard"), tables=True, sizes=SIZES)


@pytest.fixture(scope="module")
def plain(profile: CameraProfile, samples: SampleSet) -> Evaluation:
    """What is printed without --tables, of both styles."""
    return evaluate(profile, samples)


def test_a_polynomial_of_one_tone_is_that_tone() -> None:
    x, y = np.full((20, 3), 0.5), np.full((20, 3), 0.7)
    np.testing.assert_allclose(channel_polynomials(x, y)(x), y)


@pytest.mark.slow
def test_every_method_of_the_thesis_is_in_the_error_table(tables: Evaluation) -> None:
    kinds = ("uniform lattice", "nonuniform lattice", "lattice by (5.3)")
    lattices = [f"{kind} {size}" for size in SIZES for kind in kinds]
    for direction in ("render", "linearize"):
        rows = {row.method: row for row in tables.rows if (row.direction, row.shot) == (direction, "all")}
        models = {"camera model", "thesis's camera model", "f and T, no h"}
        assert set(rows) == {*models, "matrix and response", *BASELINES, *lattices}
        assert all(row.held_out for row in rows.values())
        assert (rows["camera model"].figures.de00_mean is not None) == (direction == "render")
        timed = [rows[name] for name in ("camera model", "thesis's camera model", *lattices)]
        assert all(row.fit_seconds and row.seconds_per_megapixel for row in timed)
        figures = rows["camera model"].figures
        assert figures.q1 <= figures.median <= figures.q3 <= figures.maximum


def test_the_full_model_has_the_least_raw_error(plain: Evaluation) -> None:
    rmse = {row.method: row.values["RMSE"] for row in plain.raw if row.style == "standard"}
    assert all(rmse["camera model"] < rmse[method] for method in BASELINES)
    assert rmse["camera model"] < 0.003
    whole, *channels = plain.raw[0].values.values()
    assert whole == pytest.approx(np.sqrt(np.mean(np.square(channels))))


def test_delta_is_of_points_that_no_fit_had_seen(plain: Evaluation) -> None:
    assert {"camera model", "f and T, no h"} <= {row.method for row in plain.linearization}
    for row in plain.linearization:
        assert row.count > (20 if row.method.startswith("f of exposures") else 100)  # those are of unsaturated colours
        assert row.held_out != row.method.startswith("f of exposures")  # these are fitted to the very pairs
        # Of vivid's one bracket each shot lies beyond what the others reach.
        if row.method == "camera model" and row.style == "standard":
            assert max(row.values.values()) < 0.004  # thesis, figure 4.3, on the samples fitted to


def test_delta_of_the_model_is_less_with_the_gamut_map(samples: SampleSet, profile: CameraProfile) -> None:
    inside = samples.select((samples.style == "standard") & unclipped(samples, samples.wb))
    pairs, model = pairs_of_samples(inside), profile.styles["standard"].models[0]
    first, second = model.response.linearize(pairs.first), model.response.linearize(pairs.second)
    without = delta(first, second, np.exp(pairs.log_ratio))
    with_map = delta(model.inverse_gamut_map(first), model.inverse_gamut_map(second), np.exp(pairs.log_ratio))
    assert max(with_map) < max(without) and max(with_map) < 0.004  # thesis, figure 4.3


def test_edits_of_linearized_pictures_are_nearest_by_the_full_model(plain: Evaluation) -> None:
    means = {row.method: row.values for row in plain.edited if row.style == "standard"}
    assert list(means["camera model"]) == ["−2 EV", "−1 EV", "+1 EV", "+2 EV", "warmer", "cooler"]
    for edit, difference in means["camera model"].items():
        assert difference < min(means[method][edit] for method in BASELINES)


def test_refinish_between_the_styles_of_one_scene(plain: Evaluation) -> None:
    found = {(row.source, row.target, row.method): row for row in plain.refinish}
    a, b = "standard/daylight", "vivid/daylight"
    # Another light is another scene: its RAW values have no common ratio.
    assert {key[:2] for key in found} == {(a, b), (b, a)}
    for source, target in {key[:2] for key in found}:
        rows = {method: found[source, target, method] for method in ("camera model", "f and T, no h", "unchanged")}
        assert all(row.held_out and row.shots == 6 for row in rows.values())
        rmse = {method: row.figures.rmse for method, row in rows.items()}
        assert rmse["camera model"] < rmse["f and T, no h"] < rmse["unchanged"]
        assert rmse["camera model"] < 0.02  # thesis, figure 6.2


def test_refinish_pairs_are_told_by_raw_not_by_names(samples: SampleSet, profile: CameraProfile) -> None:
    """Other surfaces or lights under the same patch names are no pairs; one scene is, at any exposure ratio."""
    light = "daylight"
    one = samples.select((samples.style == "standard") & (samples.white_balance == light))
    other = photograph_patches(CAMERA, chart_140(9)[60:120], styles=("vivid",), balances=(light,), stops=(-1, 0))
    cloudy = photograph_patches(CAMERA, chart_140()[:60], balances=("cloudy",), stops=(-1, 0))
    assert evaluate(profile, concatenate([one, other, cloudy])).refinish == ()
    same = photograph_patches(CAMERA, chart_140()[:60], styles=("vivid",), balances=(light,), stops=(-1.6,), seed=8)
    unchanged = [row for row in evaluate(profile, concatenate([one, same])).refinish if row.method == "unchanged"]
    assert {(row.source, row.shots) for row in unchanged} == {("standard/daylight", 2), ("vivid/daylight", 2)}


@pytest.mark.slow
def test_a_shot_that_the_profile_has_not_seen_is_predicted_as_it_is(samples: SampleSet) -> None:
    samples = samples.select(samples.style == "standard")
    seen = samples.select(samples.shot != "standard daylight -1")
    profile = calibrate(seen, CalibrationOptions(size=5, nonuniform=False))
    rows = {(row.method, row.shot): row for row in evaluate(profile, samples).rows if row.direction == "render"}
    new = samples.select(samples.shot == "standard daylight -1")
    own = profile.styles["standard"].render
    assert own is not None
    error = np.linalg.norm(np.clip(own(new.raw * new.wb), 0, 1) - new.srgb, axis=1)
    row = rows["lattice", "standard daylight -1"]
    assert row.held_out and row.figures.count == len(new)
    assert row.figures.mean == pytest.approx(error.mean())
    alone = evaluate(profile, new, tables=True)
    assert {row.method for row in alone.rows} == {"lattice", "camera model", "f and T, no h"}
    assert any("add them" in note for note in alone.notes)


@pytest.mark.slow
def test_two_shots_on_the_thesis_preset_without_exposure_pairs() -> None:
    """Too little for f from exposure pairs: profile and tables have the lattices, and say why no camera model."""
    one = photograph_patches(CAMERA, chart_140()[:30], balances=("daylight",), stops=(-1,))
    other = photograph_patches(CAMERA, chart_140(3)[40:70], balances=("daylight",), stops=(-0.5,), seed=1)
    samples = concatenate([one, other])
    profile = calibrate(samples, ThesisOptions(size=5, nonuniform=False))
    found = evaluate(profile, samples, tables=True, sizes=(5,))  # the search for α takes long on larger ones
    assert not profile.styles["standard"].models
    assert any("lattices alone" in note for note in profile.notes)
    assert {"lattice", "nonuniform lattice 5"} <= {row.method for row in found.rows}
    assert any("no camera model by the thesis's method" in note for note in found.notes)


@pytest.mark.slow
def test_the_json_has_the_keys_that_are_documented(tables: Evaluation, plain: Evaluation) -> None:
    document = json.loads(json.dumps(replace(plain, rows=tables.rows).as_json(), allow_nan=False))
    described = evaluation_module.__doc__ or ""
    entries = re.findall(r"^    (\w+) {2,}", described, flags=re.MULTILINE)
    assert set(document) == {*entries, "version", "tables"}
    for name in ("rows", "raw", "linearization", "edited", "refinish"):
        assert document[name]
        for key in document[name][0]:
            assert re.search(rf"\b{key}\b", described), (name, key)
    methods = {row["method"] for row in document["rows"]}
    assert methods >= {"camera model", "thesis's camera model", "nonuniform lattice 5", "lattice by (5.3) 5"}
    assert replace(tables, rows=()).as_json()["rows"] == []
