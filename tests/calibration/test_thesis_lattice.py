"""The thesis's lattices: its uniform baseline without smoothness, and node levels that lose no errors at the ends."""

import numpy as np
import pytest

from lutforge.calibration.lattice.node_levels import BINS, error_histogram
from lutforge.calibration.lattice.thesis import fit_thesis, fit_uniform
from lutforge.calibration.options import CalibrationOptions
from lutforge.solvers.lattice_regression import Regularization, fit_lattice
from lutforge.solvers.penalties import thin_plate
from tests.solvers.dense_lattice import interpolation_weights, random_levels


def test_the_thin_plate_alone_is_minimized() -> None:
    """(5.3) has no smoothness term: most nodes of a lattice of few samples are only in the thin plate's."""
    rng = np.random.default_rng(0)
    size, count = (7, 6, 5), 210
    levels = random_levels(rng, size)
    x, y = rng.random((60, 3)), rng.random((60, 3))
    terms = Regularization(thin_plate=1e-4)
    found = fit_lattice(x, y, levels, terms, tolerance=1e-11)
    weights = interpolation_weights(x, levels, "trilinear")
    plate = thin_plate(size)(np.eye(count).reshape(count, *size)).reshape(count, count)
    wanted = np.linalg.solve(weights.T @ weights + 1e-4 * plate, weights.T @ y)
    np.testing.assert_allclose(found.value.reshape(count, 3), wanted, atol=1e-5)


def test_the_uniform_baseline_fits_and_smoothness_helps_it_where_samples_are_few() -> None:
    rng = np.random.default_rng(1)
    x, unseen = rng.random((2000, 3)) ** 2, rng.random((2000, 3)) ** 2
    options = CalibrationOptions(size=9, preset="thesis", nonuniform=False)
    errors = []
    for fitted in (fit_uniform(x, np.sqrt(x), options), fit_thesis(x, np.sqrt(x), options, clips=True)):
        assert np.all(np.isfinite(fitted.values))
        errors.append(float(np.linalg.norm(fitted(unseen) - np.sqrt(unseen), axis=1).mean()))
    assert errors[1] < errors[0] < 0.1


def test_errors_at_the_ends_are_not_lost() -> None:
    """Errors that are even over the range stay so, up to 0 and 1."""
    axis = (np.arange(BINS) + 0.5) / BINS
    for histogram in error_histogram(np.repeat(axis[:, None], 3, axis=1), np.ones(BINS)):
        assert histogram == pytest.approx(1.0 / BINS)
