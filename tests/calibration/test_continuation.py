"""The guess behind a lattice, in gaps between its samples, and the same without some of its shots."""

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.continuation import Continuation, continuation
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.soft_floor import floor_width, lowered, raised
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill

CAMERA = nikon_d5100()
GAIN = CAMERA.multipliers("daylight")
RNG = np.random.default_rng(4)
ALL = np.asarray(CAMERA.linearize(RNG.uniform(0.01, 0.99, (9000, 3)), "standard", "daylight")) * GAIN
INSIDE = ALL[np.all((ALL > 0) & (ALL < 1), axis=1)]
X, UNSEEN = INSIDE[:1500], INSIDE[1500:3000]
Y, WANTED = (np.asarray(CAMERA.render(x / GAIN, "standard", "daylight")) for x in (X, UNSEEN))
FOLDS = [np.arange(len(X)) % 3 == fold for fold in range(3)]


def error(guess: Continuation, x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.clip(guess(x), 0.0, 1.0) - y, axis=1).mean())


def test_gamut_map_brings_the_guess_closer() -> None:
    base = fit_matrix_and_response(X, Y)
    plain, bent = Continuation(base, False), continuation(base, X, Y, inverse=False)
    assert error(bent, UNSEEN, WANTED) < 0.3 * error(plain, UNSEEN, WANTED)


def test_left_out_guesses_are_those_of_the_other_samples() -> None:
    """As close to a fit of its own as other centres allow, and blind to what the samples left out hold."""
    base = fit_matrix_and_response(X, Y)
    guess = continuation(base, X, Y, inverse=False)
    for mask, left in zip(FOLDS, guess.leave_out(X, Y, FOLDS), strict=True):
        alone = guess.refit(X[~mask], Y[~mask])
        assert error(left, X[mask], Y[mask]) == pytest.approx(error(alone, X[mask], Y[mask]), rel=0.1)
    bad = Y.copy()
    bad[FOLDS[0]] = RNG.random((int(FOLDS[0].sum()), 3))
    clean, blind = (guess.leave_out(X, values, FOLDS[:1])[0] for values in (Y, bad))
    assert error(blind, UNSEEN, WANTED) == pytest.approx(error(clean, UNSEEN, WANTED), rel=0.1)


def test_the_floor_and_its_inverse() -> None:
    width = floor_width(X, 0.1)
    np.testing.assert_allclose(width[:, 0], 0.1 * X.mean(axis=1))
    values = RNG.uniform(-0.3, 1.0, X.shape)
    above = raised(values, width)
    assert above.min() > 0
    seen = above > width / 3.9  # deeper ones are as good as black
    back, rate = lowered(above, width)
    np.testing.assert_allclose(back[seen], values[seen], rtol=1e-9, atol=1e-12)
    step = lowered(above + 1e-7, width)[0] - back
    np.testing.assert_allclose((step / rate)[seen], 1e-7, rtol=1e-3)


def test_a_gap_at_the_edge_of_the_gamut(monkeypatch: pytest.MonkeyPatch) -> None:
    """No cyan with little red among the samples: the cameras press it into their gamut, as they do the other hues."""
    rng, ratios = np.random.default_rng(1), []
    for camera, style in product((nikon_d5100(), sigma_sd_merrill()), ("standard", "vivid")):
        gain = camera.multipliers("daylight")
        x = np.asarray(camera.linearize(rng.uniform(0.01, 0.99, (12_000, 3)), style, "daylight")) * gain
        x = x[np.all((x > 0) & (x < 1), axis=1)]
        y = np.asarray(camera.render(x / gain, style, "daylight"))
        gap = (y[:, 0] < 0.15) & (y.max(axis=1) > 0.3)
        base = fit_matrix_and_response(x[~gap][:2000], y[~gap][:2000])
        row = []
        for source, target, inverse in ((x, y, False), (y, x, True)):
            bent = continuation(base, source[~gap][:2000], target[~gap][:2000], inverse=inverse)
            assert bent.softness > 0
            with monkeypatch.context() as patch:
                patch.setattr("lutforge.calibration.continuation.SOFTNESSES", ((0.0,), (0.0,)))
                straight = bent.refit(source[~gap][:2000], target[~gap][:2000])
            row.append(error(bent, source[gap], target[gap]) / error(straight, source[gap], target[gap]))
        ratios.append(row)
    render, linearize = np.transpose(ratios)
    assert render.max() < 1.0 and render.mean() < 0.8
    assert linearize.max() < 1.1 and linearize.mean() < 0.9


def test_no_floor_where_the_camera_clips() -> None:
    """Matrix and response alone; colours beyond the gamut are clipped, and so no samples."""
    x = RNG.uniform(0.0, 0.9, (6000, 3))
    linear = x @ CAMERA.matrix.T
    x = x[np.all((linear > 0.002) & (linear < 0.998), axis=1)][:2000]
    y = np.round(255 * fit_matrix_and_response(X, Y).render(x)) / 255
    base = fit_matrix_and_response(x, y)
    assert continuation(base, x, y, inverse=False).softness == 0.0
    assert continuation(base, y, x, inverse=True).softness == 0.0
