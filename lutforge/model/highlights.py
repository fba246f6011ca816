"""White in a finished picture says only "at least": it stays white, and neutral, under every other setting.

A code below the last is a measurement and is rendered anew as such. White is not: a sensor saturates, a camera clips
behind its white balance, and so do RAW developers before they change the exposure. Taken for the least light that
clips, it would turn into the colour of the ratio of two white balances.
"""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask

CLIPPED = 0.5 / 255.0
"""An encoded channel this near to 0 or 1 is clipped: half a code of an 8-bit file."""


def clipped(encoded: ArrayLike) -> Mask:
    """Return the mask (…,) of encoded colours (…, 3) with a channel at 0 or 255, whose RAW value is unknown."""
    values = np.asarray(encoded, dtype=np.float64)
    mask: Mask = np.any((values <= CLIPPED) | (values >= 1.0 - CLIPPED), axis=-1)
    return mask


def neutral_where_clipped(encoded: Array, balanced: Array, white: float = 1.0, to_linear: Array | None = None) -> Array:
    """Balanced linear colours (…, 3) to render anew, with what is white or black in the source `encoded` neutral.

    Where all channels are at 255 they are raised to one level, over the last half code, as a lookup table cannot jump:
    to `white`, what saturates the sensor, or to the brightest of them where that is more. Where all are at 0 they are
    lowered to the smallest. All other colours are untouched.

    to_linear: (3, 3), rows sum to 1, to the linear light of the output: the level is then no less than any of its
    channels either, so that none becomes darker where a tinted grey becomes a neutral white.
    """
    r, g, b = encoded[..., 0], encoded[..., 1], encoded[..., 2]
    least = np.minimum(np.minimum(r, g), b)
    some = (least > 1.0 - CLIPPED) | (np.maximum(np.maximum(r, g), b) <= CLIPPED)
    kept, least = balanced.copy(), least[some][:, None]
    burnt = np.clip((least - (1.0 - CLIPPED)) / CLIPPED, 0.0, 1.0)
    lights = own = balanced[some]
    if to_linear is not None:
        lights = np.concatenate([own, own @ to_linear.T], axis=-1)
    level = np.maximum(lights.max(axis=-1, keepdims=True), white)
    dark = least <= CLIPPED
    kept[some] = np.where(dark, own.min(axis=-1, keepdims=True), own + burnt * (level - own))
    return kept
