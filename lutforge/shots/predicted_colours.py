"""What a camera's JPEG would be of a RAW at a place: a quadratic of the channels, fitted where the two overlap.

The colour matrix and the tone curve are unknown; a fixed luma would invert the contrast of many edges between saturated
colours.
"""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Real, Single
from lutforge.shots.area_means import on_jpeg_pixels
from lutforge.shots.pyramid import RawLevel, ReducedJpeg
from lutforge.shots.shot import Registration


def explained(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> float:
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place.

    At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    """
    terms, use = _terms_at(raw, jpeg, place)
    codes = jpeg.codes.reshape(-1, 3)[use].astype(np.float64)
    if len(codes) < 200:
        return 0.0
    residual = codes - terms @ _least_squares(terms, codes)
    total = float(np.square(codes - codes.mean(axis=0)).sum())
    return 1 - float(np.square(residual).sum()) / max(total, 1e-9)


def predicted_luma(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> Single:
    """RAW (h, w) as the luma that the camera would make of it."""
    terms, use = _terms_at(raw, jpeg, place)
    weights = _least_squares(terms, jpeg.luma.ravel()[use].astype(np.float64)).astype(np.float32)
    constant, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    luma = np.empty(raw.channels.shape[1:], dtype=np.float32)
    for rows in range(0, len(luma), 32):  # so many stay in the cache
        r, g, b = raw.channels[:, rows : rows + 32]
        luma[rows : rows + 32] = (
            r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b) + constant
        )
    return luma


def _terms_at(raw: RawLevel, jpeg: ReducedJpeg, place: Registration) -> tuple[Array, NDArray[np.intp]]:
    """The quadratic terms (n, 10) of the RAW under some 20,000 of the JPEG's pixels, and which these are (n,)."""
    shape = (jpeg.luma.shape[0], jpeg.luma.shape[1])
    sampled = [on_jpeg_pixels(channel, raw.pixel_size, place, shape) for channel in raw.channels]
    use = np.flatnonzero((jpeg.weight * sampled[0][1]).ravel() > 0.5)
    use = use[:: max(1, len(use) // 20_000)]
    return np.stack([*_quadratic(*(plane.ravel()[use].astype(np.float64) for plane, _ in sampled))], axis=1), use


def _least_squares(terms: Array, values: Array) -> Array:
    normal = terms.T @ terms
    normal += 1e-6 * (np.trace(normal) / len(normal) + 1e-12) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, terms.T @ values))


def _quadratic(r: Real, g: Real, b: Real) -> Iterator[Real]:
    yield from (np.ones_like(r), r, g, b, r * r, g * g, b * b, r * g, g * b, b * r)
