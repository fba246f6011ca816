"""Few shots: lattices are drawn towards matrix and response away from their samples, and never end up far worse."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration import style_data
from lutforge.calibration.lattice.continuation import Continuation, continuation
from lutforge.calibration.lattice.shrinkage import REACHES, UNSHRUNK, between_nodes, reach_weights, shrinkable
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix_and_response import with_matrix_of_all
from lutforge.calibration.preparation import data_by_style
from lutforge.calibration.style_fit import fit_style
from lutforge.colour.srgb import srgb_decode
from lutforge.evaluation.methods import MATRIX_AND_RESPONSE, fit_baselines
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.response import Response
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.evaluation import evaluate
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.calibration.samples_simulated import chart_140, photograph_patches

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def samples() -> SampleSet:
    """A chart under five lights, vivid: a gamut map that a shot of other colours does not tell."""
    return photograph_patches(nikon_d5100(), chart_140(), styles=("vivid",), stops=(-1,))


def error(predict: object, x: Array, y: Array) -> float:
    assert callable(predict)
    return float(np.linalg.norm(np.clip(predict(x), 0.0, 1.0) - y, axis=1).mean())


def test_one_shot_of_few_colours_is_no_worse_than_matrix_and_response(samples: SampleSet) -> None:
    """The first 24 patches under one light against all 140 under the others, both directions."""
    few = samples.select((samples.shot == samples.shot[0]) & (samples.patch < "0024"))
    rest = next(iter(data_by_style(samples.select(samples.shot != samples.shot[0])).values()))
    train = next(iter(data_by_style(few).values()))
    style = calibrate(few, CalibrationOptions(size=17)).styles["vivid"]
    plain = fit_baselines(train)[MATRIX_AND_RESPONSE]
    assert error(style.render, rest.balanced, rest.encoded) <= 1.02 * error(plain.render, rest.balanced, rest.encoded)
    worst = 1.02 * error(plain.linearize, rest.encoded, rest.balanced)
    assert error(style.linearize, rest.encoded, rest.balanced) <= worst


def test_one_real_shot_does_not_vouch_for_what_others_show(s40_samples: SampleSet) -> None:
    """A shot of 160 colours, parts of which predict each other well, against the other four."""
    names, counts = np.unique(s40_samples.shot, return_counts=True)
    one = s40_samples.shot == names[np.argmin(counts)]
    rest = next(iter(data_by_style(s40_samples.select(~one)).values()))
    style = calibrate(s40_samples.select(one), CalibrationOptions(size=17)).styles["standard"]
    plain = fit_baselines(next(iter(data_by_style(s40_samples.select(one)).values())))[MATRIX_AND_RESPONSE]
    worst = 1.1 * error(plain.render, rest.balanced, rest.encoded)
    assert error(style.render, rest.balanced, rest.encoded) <= worst
    worst = 1.02 * error(plain.linearize, rest.encoded, rest.balanced)
    assert error(style.linearize, rest.encoded, rest.balanced) <= worst


def test_no_reach_gives_matrix_and_response_far_away_and_keeps_black_and_white(samples: SampleSet) -> None:
    data = next(iter(data_by_style(samples).values()))
    fit = fit_style(data, CalibrationOptions(size=9))
    pair = shrinkable(fit.render.lattice, fit.base, data.balanced, data.encoded, inverse=False)
    assert pair.averaged(UNSHRUNK) is fit.render.lattice
    near = pair.averaged(np.eye(len(REACHES))[0])
    plain = with_matrix_of_all(fit.base, data.balanced, data.encoded)
    green = np.array([[0.0, 1.0, 0.0]])
    np.testing.assert_allclose(np.clip(near(green), 0, 1), plain.render(green), atol=0.02)
    np.testing.assert_array_equal(near(np.zeros(3)), fit.render.lattice(np.zeros(3)))
    np.testing.assert_allclose(near(np.ones(3)), 1.0, atol=1e-9)


def test_five_shots_leave_a_lattice_as_it_is(samples: SampleSet) -> None:
    assert len(np.unique(samples.shot)) == 5
    fitted = fit_style(next(iter(data_by_style(samples).values())), CalibrationOptions(size=5))
    style = calibrate(samples, CalibrationOptions(size=5)).styles["vivid"]
    assert style.linearize is not None
    np.testing.assert_allclose(style.linearize.values, fitted.linearize.lattice.values, atol=1e-6)


def test_each_guess_is_made_once(samples: SampleSet, monkeypatch: pytest.MonkeyPatch) -> None:
    """Those of five folds beside the fit to all shots; what measures the errors takes them as they are."""
    made: list[bool] = []

    def counted(*arguments: Any, inverse: bool, **options: Any) -> Continuation:
        made.append(inverse)
        return continuation(*arguments, inverse=inverse, **options)

    monkeypatch.setattr(style_data, "continuation", counted)
    calibrate(samples, CalibrationOptions(size=5))
    assert sorted(made) == [False] * 6 + [True] * 6


def test_reaches_weigh_by_the_likelihood_of_what_was_left_out() -> None:
    even = np.full((len(REACHES), 2), 0.01)
    np.testing.assert_allclose(reach_weights(even), 1.0 / len(REACHES))
    better = even.copy()
    better[1, 0] = 0.009
    weights = reach_weights(better)
    assert weights.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(
        weights[1] / weights[0], (0.01 / 0.009) ** 30, rtol=1e-2
    )  # ten colours of three channels


def test_the_profile_holds_the_figure_that_evaluate_prints(samples: SampleSet) -> None:
    """One protocol: the same shots left out, the same lattices."""
    profile = calibrate(samples, CalibrationOptions(size=9))
    rows = [row for row in evaluate(profile, samples).rows if (row.method, row.shot) == ("lattice", "all")]
    errors = profile.styles["vivid"].errors
    assert len(rows) == 2
    for row in rows:
        assert row.figures.mean == pytest.approx(errors[f"{row.direction}_mean"], rel=1e-9)
        assert row.figures.maximum == pytest.approx(errors[f"{row.direction}_max"], rel=1e-9)


def test_a_curve_is_met_between_the_nodes_of_an_axis() -> None:
    """A response as a lattice: half as far off as by its values at the nodes, and exact at the ends."""
    response = Response(np.repeat(srgb_decode(np.linspace(0, 1, 256))[:, None], 3, axis=1))
    levels = uniform_levels(9)
    fitted, sampled = (
        Lattice(levels, between_nodes(response, levels)),
        Lattice(levels, response.linearize(grid(levels))),
    )
    colours = np.random.default_rng(0).random((2000, 3))
    truth = response.linearize(colours)
    error, before = (np.abs(lattice(colours) - truth).mean() for lattice in (fitted, sampled))
    assert error < 0.6 * before
    np.testing.assert_allclose(fitted.values[[0, -1], [0, -1], [0, -1]], [[0] * 3, [1] * 3], atol=1e-9)
