"""Clipped white of a finished picture stays white and neutral when the picture is rendered with other settings.

A code below 255 is a measurement. White is only a lower bound of the light: the sensor saturates, and cameras and RAW
developers clip after white balance. If white were taken for the least light that clips, a change of white balance would
turn it into the colour of the ratio of the two white balances. So white is rendered as grey, and what is darker rises
towards that grey by at most `RISE` codes for each code that the picture is nearer to white: one code decides nothing.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.interpolation import apply_curve

CLIPPED = 0.5 / 255.0
"""An encoded channel this near to 0 or 1 is clipped: half a code of an 8-bit file."""

RISE = 3.4
"""Codes by which the output rises at most towards white per code of the source's least channel.

The rendering's own slope, its matrix and its gamut map add to this: with 3.4 no channel of the
Canon S40 or of the demo's camera rises by more than 8 codes.
"""

SOFTNESS = 0.15
"""Width of the bend from the model to the rise, as a share of the light that is lacking to white: LUTs have no corners.
"""

STEPS = 4096
"""Entries of the table of `NeutralHighlights`."""


def clipped(encoded: ArrayLike) -> Mask:
    """Return the mask (…,) of encoded colours (…, 3) with a channel at 0 or 255, whose RAW value is unknown."""
    values = np.asarray(encoded)
    ends: Mask = (values <= CLIPPED) | (values >= 1.0 - CLIPPED)
    return np.asarray(ends[..., 0] | ends[..., 1] | ends[..., 2])  # nine times as fast as np.any over so short an axis


@dataclass(frozen=True, eq=False)
class NeutralHighlights:
    """Balanced light of a picture, raised where it comes near to burnt-out white, which ends as grey.

    white: (3,), the balanced light that the model gives for white; floor: (n, 3), the least linear light of the output
    at n even steps, from 0 to 1, of the least channel relative to white; to_linear: (3, 3), balanced light to that of
    the output; highest: where balanced light is clipped before it is rendered.
    """

    white: Array
    floor: Array
    to_linear: Array
    highest: float = 1.0

    def __call__(self, balanced: Array) -> Array:
        """Balanced linear light (…, 3) → the same, no channel of the output lower."""
        least = np.min(balanced / self.white, axis=-1, keepdims=True)
        wanted = apply_curve(self.floor, np.repeat(np.clip(least, 0.0, 1.0), 3, axis=-1))
        missing = wanted - np.minimum(balanced, self.highest) @ self.to_linear.T
        bend = SOFTNESS * np.clip(1.0 - least, 1e-9, 1.0)
        missing = np.where(missing < bend, np.maximum(missing + bend, 0.0) ** 2 / (4.0 * bend), missing)
        return np.asarray(balanced + missing @ np.linalg.inv(self.to_linear).T)


def neutral_highlights(
    to_balanced: Callable[[Array], Array],
    render: Callable[[Array], Array],
    level: float,
    to_linear: Array,
    highest: float = 1.0,
) -> NeutralHighlights:
    """Return what keeps white neutral between the two halves of a refinish.

    to_balanced: encoded source → balanced light; render: balanced light → encoded output; level: balanced light of
    white, if it is no brighter than what just saturates; to_linear, highest: as of `NeutralHighlights`.
    """
    codes = np.linspace(0.0, 1.0, 256)
    ramp = to_balanced(codes[:, None].repeat(3, axis=1))
    white = np.maximum(ramp[-1], 1e-6)
    grey = np.minimum(white_as_grey(render, np.minimum(ramp[-1], highest), level, to_linear), highest)

    # Which level of grey light makes which code of each channel of the output, and which source code has which light.
    levels = np.linspace(0.0, 1.0, 1024) ** 2
    shown = np.maximum.accumulate(render(levels[:, None] * grey))
    least = np.maximum.accumulate((ramp / white).min(axis=1))
    source = np.interp(np.linspace(0.0, 1.0, STEPS), least, codes)
    floor = np.empty((STEPS, 3))
    for c, full in enumerate(to_linear @ grey):
        output = shown[-1, c] - RISE * (1.0 - source)
        rising = np.concatenate([[True], np.diff(shown[:, c]) > 1e-6])
        light = np.interp(np.abs(output), shown[rising, c], levels[rising]) * np.maximum(np.abs(output), 1.0) ** 3
        floor[:, c] = np.sign(output) * light * full
    floor[-1] = to_linear @ grey
    return NeutralHighlights(white, floor, to_linear, highest)


def white_as_grey(render: Callable[[Array], Array], bare: Array, least: float, to_linear: Array) -> Array:
    """Return the balanced light (3,) that a camera renders grey, to stand for white at a lower exposure.

    Light that is neutral by the multipliers need not be rendered neutral: the camera's own white balance may differ, or
    its style may be warm. No channel of the grey is darker than the rendering of neutral light at the level of white,
    or of `bare`, the light (3,) that the model without this correction gives for white. least: the least level;
    to_linear: from balanced light to the linear light of the output, (3, 3). The light differs from neutral by at most
    a quarter, because a toned style has no grey. Where the sensor saturates it is neutral.
    """
    level = max(least, float(bare.max()), float((to_linear @ bare).max()))
    light = np.full(3, level)
    if level >= 1.0:
        return light
    goal = max(render(light).max(), render(bare).max(), 1e-6)
    for _ in range(40):  # each takes off a quarter of the logarithm of what is left or more
        light = np.clip(light * goal / np.maximum(render(light), 1e-6), 0.8 * level, min(1.25 * level, 1.0))
    return light
