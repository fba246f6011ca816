"""What a camera's JPEG would be of a RAW at a place: a quadratic of the channels, fitted where the two overlap.

The colour matrix and the tone curve are unknown; a fixed luma would invert the contrast of many edges between saturated
colours.
"""

from collections.abc import Iterator

import numpy as np

from lutforge.arrays import Array, Index, Single
from lutforge.shots.area_means import cells_of_jpeg
from lutforge.shots.compressed_raw import means_of_roots, quadratic
from lutforge.shots.geometry import Registration
from lutforge.shots.pyramid import RawLevel, ReducedJpeg

ENOUGH = 8_000
"""Pixels, about, that tell the ten weights of the quadratic."""


def explained(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> float:
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place.

    At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    """
    terms, use = _terms_at(raw, jpeg, place)
    codes = jpeg.codes.reshape(-1, 3)[use].astype(np.float64)
    if len(codes) < 200:
        return 0.0
    residual = codes - terms @ least_squares(terms, codes)
    total = float(np.square(codes - codes.mean(axis=0)).sum())
    return 1 - float(np.square(residual).sum()) / max(total, 1e-9)


def predicted_luma(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> Single:
    """RAW (h, w) as the luma that the camera would make of it."""
    terms, use = _terms_at(raw, jpeg, place)
    weights = least_squares(terms, jpeg.luma.ravel()[use].astype(np.float64))
    return quadratic(raw.pixels, raw.gains, weights.astype(np.float32))


def _terms_at(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> tuple[Array, Index]:
    """The quadratic terms (n, 10) of the RAW under about ENOUGH of the JPEG's pixels, and which these are (n,)."""
    borders, covers = cells_of_jpeg(place, jpeg.weight.shape, raw.pixels.shape, raw.pixel_size)
    use = np.flatnonzero((jpeg.weight * covers).ravel() > 0.5)
    use = use[:: max(1, len(use) // ENOUGH)]
    return np.stack([*quadratic_terms(*means_of_roots(raw.pixels, raw.gains, *borders, use).T)], axis=1), use


def least_squares(terms: Array, values: Array) -> Array:
    """Weights (10, …) of quadratic terms (n, 10) for values (n, …)."""
    normal = terms.T @ terms
    normal += 1e-6 * (np.trace(normal) / len(normal) + 1e-12) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, terms.T @ values))


def quadratic_terms(r: Array, g: Array, b: Array) -> Iterator[Array]:
    """The terms of a quadratic of three channels."""
    yield from (np.ones_like(r), r, g, b, r * r, g * g, b * b, r * g, g * b, b * r)
