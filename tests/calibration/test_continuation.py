"""The guess behind a lattice, and the same without some of its shots."""

import numpy as np
import pytest
from numpy.typing import NDArray

from lutforge.calibration.continuation import Continuation, continuation
from lutforge.calibration.matrix_and_response import fit_matrix_and_response
from lutforge.simulate.camera import nikon_d5100

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
