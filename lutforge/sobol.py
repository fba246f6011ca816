"""Sobol's sequence: points that fill the unit square or cube evenly, however many of them are taken.

The direction numbers are those of Joe & Kuo 2008, https://doi.org/10.1137/070709359, which SciPy's `qmc.Sobol` has,
too; but `scipy.stats` takes a second to import.
"""

import numpy as np

from lutforge.arrays import Array


def sobol(count: int, dimensions: int = 3, seed: int | None = None) -> Array:
    """Return the first points of the sequence, (count, dimensions), in [0, 1).

    dimensions: 3 at most. seed: of a digital shift, which moves the points and leaves them as even; none keeps 0 first.
    """
    bits = 30
    directions = np.ones((bits, 3), dtype=np.int64)
    directions[1, 2] = 3
    for bit in range(1, bits):  # by the primitive polynomials x + 1 and x² + x + 1
        last, last_but_one = directions[bit - 1], directions[bit - 2]
        directions[bit, 1] = last[1] ^ 2 * last[1]
        if bit > 1:
            directions[bit, 2] = last_but_one[2] ^ 2 * last[2] ^ 4 * last_but_one[2]
    directions = directions[:, :dimensions] << np.arange(bits)[::-1, None]
    points = np.zeros((1, dimensions), dtype=np.int64)
    if seed is not None:
        points = np.random.default_rng(seed).integers(0, 1 << bits, (1, dimensions))
    before = np.zeros(dimensions, dtype=np.int64)
    for direction in directions[: (count - 1).bit_length()]:  # in the order of the Gray code, twice as many each time
        points = np.concatenate([points, points ^ direction ^ before])
        before = direction
    return points[:count] / (1 << bits)
