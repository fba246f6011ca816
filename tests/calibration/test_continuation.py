"""The guess behind a lattice, in gaps between its samples, and the same without some of its shots."""

from itertools import product

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.lattice.continuation import Continuation, continuation
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
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


def test_samples_bring_the_guess_closer() -> None:
    base = fit_matrix_and_response(X, Y)
    bent = continuation(base, X, Y, inverse=False)
    plain = Continuation(base, bent.curve)
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


def test_gaps_at_the_edges_of_the_gamut() -> None:
    """No cyan with little red, nothing bright, or nothing dark among the samples: what bends the guess runs on there.

    Mean errors there, in codes of 255.
    """
    rng, codes = np.random.default_rng(1), []
    for camera, style in product((nikon_d5100(), sigma_sd_merrill()), ("standard", "vivid")):
        gain = camera.multipliers("daylight")
        x = np.asarray(camera.linearize(rng.uniform(0.01, 0.99, (12_000, 3)), style, "daylight")) * gain
        x = x[np.all((x > 0) & (x < 1), axis=1)]
        y = np.asarray(camera.render(x / gain, style, "daylight"))
        largest = y.max(axis=1)
        for gap in ((y[:, 0] < 0.15) & (largest > 0.3), largest > 0.85, largest < 0.2):
            base = fit_matrix_and_response(x[~gap][:2000], y[~gap][:2000])
            codes.append(
                [
                    255 * error(continuation(base, a[~gap][:2000], b[~gap][:2000], inverse=inverse), a[gap], b[gap])
                    for a, b, inverse in ((x, y, False), (y, x, True))
                ]
            )
    render, linearize = np.transpose(codes).reshape(2, 4, 3)
    np.testing.assert_array_less(render.max(axis=0), (14.0, 8.5, 4.0))
    np.testing.assert_array_less(linearize.max(axis=0), (8.5, 9.0, 1.1))
    assert render.mean() < 6.5 and linearize.mean() < 4.5


def test_runs_on_where_the_camera_clips() -> None:
    """Matrix and sRGB's curve, in 8 bits; colours beyond the gamut are clipped, and so no samples."""
    x = RNG.uniform(0.0, 0.9, (6000, 3))
    linear = x @ CAMERA.matrix.T
    inside = np.all((linear > 0.002) & (linear < 0.998), axis=1)
    assert np.abs(linear[~inside]).max() > 1.2
    clipped = np.clip(linear, 0.0, 1.0)
    y = np.round(255 * np.where(clipped < 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)) / 255
    base = fit_matrix_and_response(x[inside][:2000], y[inside][:2000])
    guess = continuation(base, x[inside][:2000], y[inside][:2000], inverse=False)
    assert error(guess, x[~inside], y[~inside]) < 1 / 255
    assert np.abs(np.clip(guess(x[~inside]), 0.0, 1.0) - y[~inside]).max() < 12 / 255


@pytest.mark.parametrize("inverse", [False, True])
def test_stray_samples_do_not_bend_it(inverse: bool) -> None:
    """One in twenty-five is of another colour."""
    x, y, unseen, wanted = (Y, X, WANTED, UNSEEN) if inverse else (X, Y, UNSEEN, WANTED)
    base = fit_matrix_and_response(X, Y)
    stray = y.copy()
    stray[::25] = RNG.random(stray[::25].shape)
    clean, spoilt = (continuation(base, x, values, inverse=inverse) for values in (y, stray))
    assert error(spoilt, unseen, wanted) < 1.25 * error(clean, unseen, wanted)
