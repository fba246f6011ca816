"""Clipped white of a finished picture stays white and neutral when the picture is rendered with other settings.

A code below 255 is a measurement. White is only a lower bound of the light: the sensor saturates, and cameras and RAW
developers clip after white balance. If white were taken for the least light that clips, a change of white balance would
turn it into the colour of the ratio of the two white balances.
"""

from collections.abc import Callable

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


def neutral_where_clipped(
    encoded: Array, balanced: Array, white: ArrayLike = 1.0, to_linear: Array | None = None
) -> Array:
    """Return balanced linear colours (…, 3), made neutral where the source `encoded` is white or black.

    Where all channels are at 255 the colour is raised to `white`, one level or (3,), or to the least multiple of it
    that lowers no channel. It is raised gradually over the last half code, because a lookup table cannot jump. Where
    all channels are at 0 they are lowered to the smallest. Other colours do not change.

    to_linear: (3, 3), rows sum to 1, to the linear light of the output, of which no channel is lowered either.
    """
    r, g, b = encoded[..., 0], encoded[..., 1], encoded[..., 2]
    least = np.minimum(np.minimum(r, g), b)
    some = (least > 1.0 - CLIPPED) | (np.maximum(np.maximum(r, g), b) <= CLIPPED)
    kept, least = balanced.copy(), least[some][:, None]
    burnt = np.clip((least - (1.0 - CLIPPED)) / CLIPPED, 0.0, 1.0)
    own, whites = balanced[some], np.broadcast_to(np.asarray(white, dtype=np.float64), 3)
    ratios = own / whites
    if to_linear is not None:
        ratios = np.concatenate([ratios, (own @ to_linear.T) / (to_linear @ whites)], axis=-1)
    raised = np.maximum(ratios.max(axis=-1, keepdims=True), 1.0) * whites
    dark = least <= CLIPPED
    kept[some] = np.where(dark, own.min(axis=-1, keepdims=True), own + burnt * (raised - own))
    return kept


def white_as_grey(render: Callable[[Array], Array], bare: Array, least: float, to_linear: Array) -> Array:
    """Return the balanced light (3,) that a camera renders grey, to stand for white at a lower exposure.

    Light that is neutral by the multipliers need not be rendered neutral: the camera's own white balance may differ, or
    its style may be warm. No channel of the grey is darker than the rendering of neutral light at the level of white,
    or of `bare`, the light (3,) that the model without this correction gives for white. least: the least level;
    to_linear: as for `neutral_where_clipped`. The light differs from neutral by at most a quarter, because a toned
    style has no grey. Where the sensor saturates it is neutral.
    """
    level = max(least, float(bare.max()), float((to_linear @ bare).max()))
    light = np.full(3, level)
    if level >= 1.0:
        return light
    goal = max(render(light).max(), render(bare).max(), 1e-6)
    for _ in range(40):  # each takes off a quarter of the logarithm of what is left or more
        light = np.clip(light * goal / np.maximum(render(light), 1e-6), 0.8 * level, min(1.25 * level, 1.0))
    return light
