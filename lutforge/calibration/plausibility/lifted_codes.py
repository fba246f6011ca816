"""The code that JPEGs have where there is no light: 0 as cameras write them, more where black was lifted afterwards.

It has two signs. One is the bend of the tone curve near black. The other, where dark tones are few or straight, is the
code at which strong colours pile up in a channel that they leave without light.
"""

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.plausibility.colour_chain import CODE
from lutforge.colour.srgb import srgb_encode


def lift(encoded: Array, linear: Array) -> tuple[float, float]:
    """Return the JPEG code at which there is no light, and the log odds of that code against 0, by the clearer sign.

    encoded: (n, 3); linear: (n, 3), what the matrix makes of the samples' balanced RAW.
    """
    return max(_bend(encoded, linear), _pile(encoded, linear), key=lambda told: told[1])


def _bend(encoded: Array, linear: Array) -> tuple[float, float]:
    """Fit I = z + C s(k y) to dark samples with linear values y; z is the code.

    s is sRGB's curve: for small k it is a straight line, for large k a power of 1/2.4.
    """
    dark = (encoded < 56 * CODE) & (linear > 2e-5)
    if dark.sum() < 30:
        return 0.0, 0.0
    y, codes = linear[dark], 255 * encoded[dark]
    shapes = srgb_encode(y[None, :] * 2.0 ** np.arange(-5.0, 7.0)[:, None])
    lifts = np.arange(-3.0, 20.0)
    errors = np.full(len(lifts), np.inf)
    for place, code in enumerate(lifts):
        ratio = np.median((codes - code) / shapes, axis=1)
        errors[place] = np.mean(np.abs(codes - code - ratio[:, None] * shapes), axis=1).min()
    best = int(np.argmin(errors))
    if best == len(lifts) - 1:  # no curve of a camera fits, whatever black is
        return 0.0, 0.0
    usual = errors[np.abs(lifts) <= 3.0].min()
    return float(lifts[best]), 0.1 * min(dark.sum(), 200) * float(np.log((usual + 0.4) / (errors[best] + 0.4)))


def _pile(encoded: Array, linear: Array) -> tuple[float, float]:
    """Take the second lowest code z of channels that have no light by the matrix, by more than its error.

    If black were at 0 and the density of codes rose linearly from there, a code below z + 4 would be above z with the
    probability 1 − (z / (z + 4))². Neighbouring colours are alike, so that a quarter of them counts. Unlifted, z is 5
    to 6 (S40, D40), since areas with a pixel at 0 or 1 are left out.
    """
    codes = np.sort(255 * encoded[linear < -0.005])
    if len(codes) < 2:
        return 0.0, 0.0
    lowest = float(codes[1])
    count = np.searchsorted(codes, lowest + 4.0)
    return lowest - 5.0, -0.25 * float(count * np.log(1.0 - (lowest / (lowest + 4.0)) ** 2))
