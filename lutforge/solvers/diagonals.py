"""The product of a matrix that is stored by diagonals with several vectors at once.

SciPy multiplies one vector at a time, one diagonal after the other, so that the matrix and the result pass through
memory again and again. Here a stretch of the result stays in the cache while all diagonals are added to it.
"""

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from lutforge.arrays import Array
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.threads import run, shares

STRETCH = 1024
"""Rows whose results are summed together: with three vectors they take 24 KB."""


@compiled(fastmath=REASSOCIATED)
def _multiply(
    lines: Array, offsets: NDArray[np.int64], diagonal: Array, b: Array, image: Array, first: int, last: int
) -> None:
    """Fill rows first … last − 1 of image = (A + diag(diagonal)) b, all vectors as rows (c, n)."""
    count = lines.shape[1]
    for start in range(first, last, STRETCH):
        stop = min(start + STRETCH, last)
        for c in range(len(b)):
            part, vector, weight = image[c, start:stop], b[c, start:stop], diagonal[c, start:stop]
            for i in range(stop - start):
                part[i] = weight[i] * vector[i]
        for k in range(len(offsets)):
            step = offsets[k]
            low, high = max(start, -step), min(stop, count - step)
            if low >= high:
                continue  # a slice with a negative end would reach from the other end
            line = lines[k, low + step : high + step]
            for c in range(len(b)):
                part, vector = image[c, low:high], b[c, low + step : high + step]
                for i in range(len(line)):
                    part[i] += line[i] * vector[i]


def product(matrix: sparse.dia_array, diagonal: Array, b: Array) -> Array:
    """(A + diag(d)) b for vectors b (c, n), and for each of them its own diagonal d (c, n). Multi-threaded."""
    lines, offsets = np.ascontiguousarray(matrix.data), matrix.offsets.astype(np.int64)
    image = np.empty_like(b)
    run(lambda first, last: _multiply(lines, offsets, diagonal, b, image, first, last), shares(b.shape[1], 16_384))
    return image
