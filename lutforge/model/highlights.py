"""White in a finished picture says only "at least": it stays white, and neutral, under every other setting.

A code below the last is a measurement and is rendered anew as such. White is not: a sensor saturates, a camera clips
behind its white balance, and so do RAW developers before they change the exposure. Taken for the least light that
clips, it would turn into the colour of the ratio of two white balances.
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
    """Balanced linear colours (…, 3) to render anew, with what is white or black in the source `encoded` neutral.

    Where all channels are at 255 they are raised, over the last half code, as a lookup table cannot jump: to `white`,
    one level or (3,), or to the least multiple of it that has no channel below theirs. Where all are at 0 they are
    lowered to the smallest. All other colours are untouched.

    to_linear: (3, 3), rows sum to 1, to the linear light of the output: no channel of it becomes darker either where a
    tinted grey becomes a neutral white.
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
    """Return the balanced light (3,) for white, at an exposure of less: what a camera renders as a bright enough grey.

    The multipliers' neutral need not be the camera's: its own white balance may differ, or its style be warm. The grey
    is no darker in any channel than what is rendered of neutral light at the level of white, and of white as the bare
    model has it. bare: (3,) that light; least: the least level; to_linear: as of `neutral_where_clipped`. Light is
    within a quarter of neutral, as a toned style has no grey; where the sensor saturates it is neutral.
    """
    level = max(least, float(bare.max()), float((to_linear @ bare).max()))
    light = np.full(3, level)
    if level >= 1.0:
        return light
    goal = max(render(light).max(), render(bare).max(), 1e-6)
    for _ in range(40):  # each takes off a quarter of the logarithm of what is left or more
        light = np.clip(light * goal / np.maximum(render(light), 1e-6), 0.8 * level, min(1.25 * level, 1.0))
    return light
