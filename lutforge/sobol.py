"""Sobol's sequence: points that fill the unit square or cube evenly, for any number of points.

The direction numbers are those of Joe & Kuo 2008, https://doi.org/10.1137/070709359. SciPy's `qmc.Sobol` has the same,
but `scipy.stats` takes a second to import.
"""

import numpy as np

from lutforge.arrays import Array


def sobol(count: int, dimensions: int = 3, seed: int | None = None) -> Array:
    """Return the first points of the sequence, (count, dimensions), in [0, 1).

    dimensions: 3 at most. seed: of a digital shift, after which the points are as even; None: no shift, 0 comes first.
    """
    bits = 30
    directions = np.ones((bits, 3), dtype=np.int64)
    directions[1, 2] = 3
    for bit in range(1, bits):  # by the primitive polynomials x + 1 and x² + x + 1
        last = directions[bit - 1]
        last_but_one = directions[bit - 2]
        directions[bit, 1] = last[1] ^ 2 * last[1]
        if bit > 1:
            directions[bit, 2] = last_but_one[2] ^ 2 * last[2] ^ 4 * last_but_one[2]
    directions = directions[:, :dimensions] << np.arange(bits)[::-1, None]
    points = np.zeros((1, dimensions), dtype=np.int64)
    if seed is not None:
        points = np.random.default_rng(seed).integers(0, 1 << bits, (1, dimensions))
    # In the order of the Gray code; each direction doubles the number of points.
    previous = np.zeros(dimensions, dtype=np.int64)
    for direction in directions[: (count - 1).bit_length()]:
        points = np.concatenate([points, points ^ direction ^ previous])
        previous = direction
    return points[:count] / (1 << bits)
