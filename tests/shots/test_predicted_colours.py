"""Roots of RAW are computed only where they are looked at, and are what NumPy makes of the whole picture."""

import numpy as np

from lutforge.shots.geometry import Registration
from lutforge.shots.pyramid import cells_of_jpeg, means_of_roots, on_jpeg_pixels, quadratic

RAW = np.random.default_rng(0).uniform(-0.01, 1.0, (40, 50, 3)).astype(np.float32)
GAINS = np.array([1.5, 1.0, 2.0], np.float32)
ROOTS = np.sqrt(np.maximum(RAW, 0) * GAINS)


def test_a_quadratic_of_the_roots() -> None:
    weights = np.random.default_rng(1).normal(0, 1, 10).astype(np.float32)
    r, g, b = np.moveaxis(ROOTS, 2, 0)
    terms = np.stack([np.ones_like(r), r, g, b, r * r, g * g, b * b, r * g, g * b, b * r])
    np.testing.assert_allclose(quadratic(RAW, GAINS, weights), np.tensordot(weights, terms, 1), atol=1e-5)


def test_means_of_roots_over_some_cells() -> None:
    place, shape = Registration(2.3, 1.2, 0.7, 1.0), (15, 18)
    borders, covers = cells_of_jpeg(place, shape, RAW.shape, 1.0)
    cells = np.flatnonzero(covers)[::7]
    whole = [on_jpeg_pixels(np.ascontiguousarray(ROOTS[..., channel]), 1.0, place, shape)[0] for channel in range(3)]
    wanted = np.stack(whole, axis=-1).reshape(-1, 3)[cells]
    np.testing.assert_allclose(means_of_roots(RAW, GAINS, *borders, cells), wanted, atol=1e-5)
