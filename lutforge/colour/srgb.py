"""Linear and encoded sRGB (IEC 61966-2-1): the one place of its curve and its matrix."""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.colour.chromaticities import xyz_matrix

SRGB_TO_XYZ = xyz_matrix("sRGB")
"""(3, 3): linear sRGB → XYZ, as derived from its chromaticities; the standard rounds it to four digits."""
D65 = SRGB_TO_XYZ.sum(axis=1)
"""XYZ of sRGB's white."""


def srgb_encode(linear: ArrayLike) -> Array:
    """Linear sRGB in [0, ∞) to encoded sRGB."""
    x = np.asarray(linear, dtype=np.float64)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * np.maximum(x, 0.0031308) ** (1 / 2.4) - 0.055)


def srgb_decode(encoded: ArrayLike) -> Array:
    """Encoded sRGB in [0, ∞) to linear sRGB: the inverse of `srgb_encode`."""
    v = np.asarray(encoded, dtype=np.float64)
    return np.where(v <= 12.92 * 0.0031308, v / 12.92, ((v + 0.055) / 1.055) ** 2.4)


def chromaticities(linear: Array) -> Array:
    """CIE 1931 xy (n, 2) of linear sRGB (n, 3); black lies at the white point."""
    xyz = linear @ SRGB_TO_XYZ.T
    total = xyz.sum(axis=1, keepdims=True)
    dark = total[:, 0] < 1e-6
    xy = xyz[:, :2] / np.where(dark[:, None], 1.0, total)
    xy[dark] = D65[:2] / D65.sum()
    return np.asarray(xy)
