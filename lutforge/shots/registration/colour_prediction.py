"""Prediction of a camera's JPEG from its RAW, and back, while the two are not yet in place.

A quadratic of the channels, fitted where the two overlap: the colour matrix and the tone curve are unknown; a fixed
luma would invert the contrast of many edges between saturated colours. RAW is compressed like a picture, by square
roots, only where a step of a registration looks at it: roots make the noise of photons equal at all brightnesses
(Anscombe 1948, https://doi.org/10.1093/biomet/35.3-4.246), and come near enough to a camera's tone curve for a
quadratic of them to predict its luma.
"""

import numpy as np

from lutforge.arrays import Array, Index, Single
from lutforge.compiled import compiled
from lutforge.shots.geometry import Registration
from lutforge.shots.registration.reduced_copies import RawLevel, ReducedJpeg, cells_of_jpeg

FITTED_PIXELS = 4_000
"""Pixels, about, that determine the ten weights of the quadratic."""
LEAST_PIXELS = 200
"""Pixels below which nothing is explained: ten weights of three channels fit them by chance."""


def explained(raw: RawLevel, jpeg: ReducedJpeg, registration: Registration) -> float:
    """Share of the variance of the JPEG's colours that a quadratic of the RAW's channels explains at a place."""
    # At a wrong place the layout may agree by chance or symmetry; the colours hardly do.
    roots, use = _roots_at(raw, jpeg, registration)
    codes = jpeg.codes.reshape(-1, 3)[use].astype(np.float64)
    if len(codes) < LEAST_PIXELS:
        return 0.0
    terms = quadratic_terms(roots)
    residual = codes - terms @ least_squares(terms, codes)
    total = float(np.square(codes - codes.mean(axis=0)).sum())
    return 1 - float(np.square(residual).sum()) / max(total, 1e-9)


def predicted_luma(raw: RawLevel, jpeg: ReducedJpeg, registration: Registration) -> Single:
    """RAW (h, w) as the luma that the camera would render of it."""
    roots, use = _roots_at(raw, jpeg, registration)
    weights = least_squares(quadratic_terms(roots), jpeg.luma.ravel()[use].astype(np.float64))
    return quadratic(raw.pixels, raw.gains, weights.astype(np.float32))


def channel_roots(raw: RawLevel, jpeg: ReducedJpeg, registration: Registration) -> list[tuple[Single, Single]]:
    """The root of each channel of the RAW (h, w), and its prediction (H, W) by a quadratic of the JPEG's codes."""
    roots, use = _roots_at(raw, jpeg, registration)
    weights = least_squares(quadratic_terms(jpeg.codes.reshape(-1, 3)[use].astype(np.float64)), roots)

    squares = np.square(jpeg.codes)  # `quadratic` takes roots
    ones = np.ones(3, np.float32)
    pairs = []
    for channel in range(3):
        root = np.sqrt(np.maximum(raw.pixels[..., channel], 0) * raw.gains[channel])
        predicted = quadratic(squares, ones, weights[:, channel].astype(np.float32))
        pairs.append((root, predicted))
    return pairs


def _roots_at(raw: RawLevel, jpeg: ReducedJpeg, registration: Registration) -> tuple[Array, Index]:
    """The roots (n, 3) of the RAW under about FITTED_PIXELS of the JPEG's pixels, and which these are (n,)."""
    borders, covers = cells_of_jpeg(registration, jpeg.weight.shape, raw.pixels.shape, raw.pixel_size)
    use = np.flatnonzero((jpeg.weight * covers).ravel() > 0.5)
    use = use[:: max(1, len(use) // FITTED_PIXELS)]
    means = np.zeros((len(use), 3))
    _means_of_roots(raw.pixels, raw.gains, *borders, use, means)
    return means, use


def least_squares(terms: Array, values: Array) -> Array:
    """Weights (10, …) of quadratic terms (n, 10) for values (n, …)."""
    normal = terms.T @ terms
    normal += 1e-6 * (np.trace(normal) / len(normal) + 1e-12) * np.eye(len(normal))
    return np.asarray(np.linalg.solve(normal, terms.T @ values))


def quadratic_terms(channels: Array) -> Array:
    """The terms (n, 10) of a quadratic of three channels (n, 3): 1, r, g, b, r², g², b², rg, gb, br."""
    ones, others = np.ones_like(channels[:, :1]), np.roll(channels, -1, axis=1)
    return np.concatenate([ones, channels, channels * channels, channels * others], axis=1)


def quadratic(raw: Single, gains: Single, weights: Single) -> Single:
    """A quadratic (h, w) of the roots of RAW (h, w, 3) times gains (3,), with weights (10,) of `quadratic_terms`."""
    values = np.empty(raw.shape[:2], np.float32)
    _quadratic(np.ascontiguousarray(raw), np.tile(gains, raw.shape[1]), weights, values)
    return values


@compiled(fastmath={"contract"})
def _quadratic(raw: Single, gains: Single, weights: Single, values: Single) -> None:
    """Fill values (h, w). gains: (3 w,) of the values of a row."""
    start, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    roots = np.empty(len(gains), np.float32)
    for y in range(values.shape[0]):
        line, to = raw[y].ravel(), values[y]
        for x in range(len(roots)):
            roots[x] = np.sqrt(max(line[x], np.float32(0)) * gains[x])
        for x in range(len(to)):
            r, g, b = roots[3 * x], roots[3 * x + 1], roots[3 * x + 2]
            to[x] = r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b) + start


@compiled()
def _means_of_roots(raw: Single, gains: Single, rows: Array, columns: Array, cells: Index, means: Array) -> None:
    """Add to means (n, 3) of the roots of RAW times gains over some cells, row by row, of a grid with these borders."""
    width = len(columns) - 1
    for index in range(len(cells)):
        top, bottom = rows[cells[index] // width], rows[cells[index] // width + 1]
        left, right = columns[cells[index] % width], columns[cells[index] % width + 1]
        for y in range(int(np.floor(top)), int(np.ceil(bottom))):
            tall = min(y + 1.0, bottom) - max(float(y), top)
            for x in range(int(np.floor(left)), int(np.ceil(right))):
                share = tall * (min(x + 1.0, right) - max(float(x), left)) / ((bottom - top) * (right - left))
                for channel in range(3):
                    means[index, channel] += share * np.sqrt(max(raw[y, x, channel], np.float32(0)) * gains[channel])
