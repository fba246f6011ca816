"""Bounded least squares beside SciPy's own solver."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lutforge.solvers.bounded_least_squares import bounded_least_squares

LOWER = np.concatenate([np.linspace(0.0, 0.01, 33), [-3.0, -3.0]])
UPPER = np.concatenate([[0.05], np.full(32, np.inf), [3.0, 3.0]])
"""As of a curve that rises in steps, and two entries of a matrix."""


@pytest.mark.parametrize("seed", range(8))
def test_bounded_least_squares_finds_the_bounds_that_hold(seed: int) -> None:
    """As a general solver does: scipy's, which is slower by far."""
    rng = np.random.default_rng(seed)
    design, right = rng.normal(size=(60, len(LOWER))), rng.normal(size=60)
    found = bounded_least_squares(design.T @ design, design.T @ right, LOWER, UPPER)
    wanted = lsq_linear(design, right, (LOWER, UPPER), method="bvls", tol=1e-14).x
    assert np.any(found == LOWER)
    np.testing.assert_allclose(found, wanted, atol=1e-9)
    for like in (found, LOWER, np.full(len(LOWER), 0.01)):  # right and wrong guesses of the bounds that hold
        again = bounded_least_squares(design.T @ design, design.T @ right, LOWER, UPPER, like)
        np.testing.assert_allclose(again, found, atol=1e-9)
