"""Linear and encoded sRGB (IEC 61966-2-1): the one place of its curve and its matrix, and ΔE00 between its colours."""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.errors import ImageError

Chromaticities = tuple[tuple[float, float], ...]
"""Chromaticities (x, y) of red, green, blue and white."""

SRGB_CHROMATICITIES: Chromaticities = ((0.64, 0.33), (0.3, 0.6), (0.15, 0.06), (0.3127, 0.3290))


def xyz_matrix(chromaticities: Chromaticities) -> Array:
    """The matrix (3, 3) from linear RGB of a space to CIE XYZ, with Y = 1 for white (SMPTE RP 177-1993)."""
    x, y = np.array(chromaticities).T
    directions = np.stack([x / y, np.ones(4), (1.0 - x - y) / y])
    return np.asarray(directions[:, :3] * np.linalg.solve(directions[:, :3], directions[:, 3]))


SRGB_TO_XYZ = xyz_matrix(SRGB_CHROMATICITIES)
"""The matrix (3, 3) from linear sRGB to XYZ, derived from its chromaticities; the standard rounds it to four digits."""
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


def srgb_to_lab(encoded: Array) -> Array:
    """Encoded sRGB (…, 3), clamped to [0, 1] → CIE L*a*b* under D65 (…, 3). CIE 15:2004, section 8.2.1."""
    ratio = srgb_decode(np.clip(encoded, 0.0, 1.0)) @ (SRGB_TO_XYZ / D65[:, None]).T
    f = np.where(ratio > (24 / 116) ** 3, np.cbrt(ratio), (841 / 108) * ratio + 16 / 116)
    x, y, z = np.moveaxis(f, -1, 0)
    return np.stack([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)], axis=-1)


def delta_e_2000(first: Array, second: Array) -> Array:
    """CIE ΔE00 of two arrays of encoded sRGB colours (…, 3) → (…)."""
    return lab_delta_e_2000(srgb_to_lab(first), srgb_to_lab(second))


def lab_delta_e_2000(first: Array, second: Array) -> Array:
    """CIE ΔE00 of two arrays of L*a*b* colours (…, 3) → (…).

    Sharma, Wu and Dalal 2005, equations 2–22, https://doi.org/10.1002/col.20070. It is written out here because
    importing colour-science takes longer than a calibration.
    """
    (l1, a1, b1), (l2, a2, b2) = np.moveaxis(first, -1, 0), np.moveaxis(second, -1, 0)
    mean_chroma = ((np.hypot(a1, b1) + np.hypot(a2, b2)) / 2) ** 7
    stretch = 1.0 + 0.5 * (1.0 - np.sqrt(mean_chroma / (mean_chroma + 25.0**7)))
    a1, a2 = a1 * stretch, a2 * stretch
    c1, c2 = np.hypot(a1, b1), np.hypot(a2, b2)
    h1, h2 = np.arctan2(b1, a1) % (2 * np.pi), np.arctan2(b2, a2) % (2 * np.pi)

    # The differences of lightness, chroma and hue (equations 8 to 11).
    grey = c1 * c2 == 0
    turn = np.where(grey, 0.0, (h2 - h1 + np.pi) % (2 * np.pi) - np.pi)
    turn = np.where((turn == -np.pi) & (h2 > h1), np.pi, turn)
    lightness = l2 - l1
    chroma = c2 - c1
    hue = 2.0 * np.sqrt(c1 * c2) * np.sin(turn / 2)

    # Their weights and the rotation at the mean of the two colours (equations 12 to 21).
    mean = (l1 + l2) / 2
    c = (c1 + c2) / 2
    h = np.where(grey, h1 + h2, h1 + turn / 2)
    t = (
        1.0 - 0.17 * np.cos(h - np.pi / 6) + 0.24 * np.cos(2 * h)
        + 0.32 * np.cos(3 * h + np.pi / 30) - 0.20 * np.cos(4 * h - 63 * np.pi / 180)
    )  # fmt: skip
    degrees = np.degrees(h) % 360
    rotation = np.radians(60.0 * np.exp(-(((degrees - 275.0) / 25.0) ** 2)))
    bend = -2.0 * np.sqrt(c**7 / (c**7 + 25.0**7)) * np.sin(rotation)
    s_l = 1.0 + 0.015 * (mean - 50.0) ** 2 / np.sqrt(20.0 + (mean - 50.0) ** 2)
    of_l, of_c, of_h = lightness / s_l, chroma / (1.0 + 0.045 * c), hue / (1.0 + 0.015 * c * t)
    return np.asarray(np.sqrt(np.maximum(of_l**2 + of_c**2 + of_h**2 + bend * of_c * of_h, 0.0)))


def checked_colours(x: ArrayLike) -> Array:
    """Colours (…, 3) as float64.

    Raises ImageError on another shape, and on integers, whose scale is unknown: but not on lists of 0 and 1.
    """
    try:
        values = np.asarray(x)
    except ValueError as error:
        raise ImageError(f"colours have shape (…, 3), not rows of different lengths ({error})") from error
    plain = not isinstance(x, np.ndarray) and values.dtype.kind in "iu" and bool(np.all((values == 0) | (values == 1)))
    if values.dtype.kind != "f" and not plain and values.ndim > 0:
        raise ImageError(f"pixels of type {values.dtype}: scale them to [0, 1] first, such as pixels / 255.0")
    if values.ndim == 0 or values.shape[-1] != 3:
        raise ImageError(f"colours have shape (…, 3), not {values.shape}; pass pixels[..., :3] of an image with alpha")
    return np.asarray(values, dtype=np.float64)
