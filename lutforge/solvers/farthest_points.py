"""Farthest-point sampling: points that cover a set evenly (Gonzalez 1985, https://doi.org/10.1016/0304-3975(85)90224-5)."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array


def farthest_points(points: Array, count: int) -> NDArray[np.intp]:
    """Choose `count` of the points (n, 3): the darkest first, then always the one farthest from those chosen."""
    chosen = [int(np.argmin(points.sum(axis=1)))]
    distance = np.linalg.norm(points - points[chosen[0]], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(points - points[chosen[-1]], axis=1))
    return np.array(chosen)
