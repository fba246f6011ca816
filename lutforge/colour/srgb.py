"""Linear and encoded sRGB (IEC 61966-2-1): the one place of its curve and its matrix."""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array

SRGB_TO_XYZ = np.array(
    [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
)
"""Linear sRGB → XYZ, D65 (http://www.brucelindbloom.com/Eqn_RGB_XYZ_Matrix.html)."""
D65 = np.array([0.95047, 1.0, 1.08883])
"""XYZ of sRGB's white, as that matrix has it."""


def srgb_encode(linear: ArrayLike) -> Array:
    """Linear sRGB in [0, ∞) to encoded sRGB."""
    x = np.asarray(linear, dtype=np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: ArrayLike) -> Array:
    """Encoded sRGB in [0, ∞) to linear sRGB: the inverse of `srgb_encode`."""
    v = np.asarray(encoded, dtype=np.float64)
    return np.where(v <= 12.92 * 0.0031308, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)
