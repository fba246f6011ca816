"""A soft floor at 0, as wide as the colour is bright: how cameras press colours beyond the output's gamut into it.

s(u) = (u + √(u² + 4w²)) / 2 is u where u ≫ w, w at u = 0, and falls to 0 below; its inverse is s − w²/s.
"""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_WIDTH = 1e-6
DEEPEST = 4.0
"""Values below 1/DEEPEST of the width are taken as that: the inverse does not go deeper."""


def floor_width(linear: Array, softness: float) -> Array:
    """w (…, 1) at linear light (…, 3): its mean times the softness."""
    width: Array = softness * np.maximum(linear.mean(axis=-1, keepdims=True), LEAST_WIDTH)
    return width


def raised(values: Array, width: Array) -> Array:
    """s of values (…, 3), any numbers; width: (…, 1)."""
    return np.asarray(0.5 * (values + np.sqrt(values**2 + 4.0 * width**2)))


def lowered(values: Array, width: Array) -> tuple[Array, Array]:
    """The inverse of s at values (…, 3), and its derivative."""
    values = np.maximum(values, width / DEEPEST)
    return values - width**2 / values, 1.0 + (width / values) ** 2
