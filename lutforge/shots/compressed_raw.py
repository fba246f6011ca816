"""RAW compressed like a picture, by square roots, computed only where a step of a registration looks at it.

Roots make the noise of photons alike at all brightnesses (Anscombe 1948, https://doi.org/10.1093/biomet/35.3-4.246),
and come near enough to a camera's tone curve for a quadratic of them to tell its luma.
"""

import numpy as np

from lutforge.arrays import Array, Index, Pixels, Single
from lutforge.compiled import compiled


def quadratic(raw: Pixels, gains: Single, weights: Single) -> Single:
    """Return a quadratic (h, w) of the roots of RAW (h, w, 3) times gains (3,).

    weights: (10,) of 1, r, g, b, r², g², b², rg, gb, br.
    """
    values = np.empty(raw.shape[:2], np.float32)
    _quadratic(np.ascontiguousarray(raw), np.tile(gains, raw.shape[1]), weights, values)
    return values


def means_of_roots(raw: Pixels, gains: Single, rows: Array, columns: Array, cells: Index) -> Array:
    """Return the means (n, 3) of the roots of RAW (h, w, 3) times gains (3,) over some cells of a grid.

    rows, columns: the H + 1 and W + 1 borders of the grid, in pixels of the RAW, within it; cells: (n,), row by row.
    """
    means = np.zeros((len(cells), 3))
    _means_of_roots(raw, gains, rows, columns, cells, means)
    return means


@compiled(fastmath={"contract"})
def _quadratic(raw: Pixels, gains: Single, weights: Single, values: Single) -> None:
    """Fill values (h, w). gains: (3 w,) of the values of a row."""
    constant, in_r, in_g, in_b, rr, gg, bb, rg, gb, br = weights
    roots = np.empty(len(gains), np.float32)
    for y in range(values.shape[0]):
        line, to = raw[y].ravel(), values[y]
        for x in range(len(roots)):
            roots[x] = np.sqrt(max(line[x], np.float32(0)) * gains[x])
        for x in range(len(to)):
            r, g, b = roots[3 * x], roots[3 * x + 1], roots[3 * x + 2]
            to[x] = (
                r * (in_r + rr * r + rg * g + br * b) + g * (in_g + gg * g + gb * b) + b * (in_b + bb * b) + constant
            )


@compiled()
def _means_of_roots(raw: Pixels, gains: Single, rows: Array, columns: Array, cells: Index, means: Array) -> None:
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
