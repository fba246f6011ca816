"""Clipped white of a finished picture stays white and neutral when the picture is rendered with other settings.

A code below 255 is a measurement. White is only a lower bound of the light: the sensor saturates, and cameras and RAW
developers clip after white balance. If white were taken for the least light that clips, a change of white balance would
turn it into the colour of the ratio of the two white balances. So white is rendered as grey, and what is darker rises
towards that grey by at most `RISE` codes for each code that the picture is nearer to white: one code decides nothing.
Nothing of which the picture shows a channel below `WHITE_FROM` is changed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.interpolation import apply_curve

WHITE_FROM = 180.0 / 255.0
"""The least channel of a picture above which a colour may be part of burnt-out white.

Below it, colours of a picture are measurements. The nearer to 1, the steeper is the rise to white.
"""

RISE = 1.0 / (1.0 - WHITE_FROM)
"""Codes by which the output rises at most towards white per code of the source's least channel.

The rendering's own slope, its matrix and its gamut map add to this.
"""

SOFTNESS = 0.15
"""Width of the bend from the model to the rise, as a share of the rise and of the codes that are lacking to white.

LUTs have no corners.
"""

FLOOR_ENTRIES = 4096
"""Entries of the table of `NeutralHighlights`."""


@dataclass(frozen=True, eq=False)
class NeutralHighlights:
    """Balanced light of a picture, raised where the picture comes near to burnt-out white, which ends as grey.

    What is near white is what the picture shows, not its RAW: strong colours can be bright in all channels of a sensor.
    white: (3,), the balanced light that the model gives for white; shown: balanced light (…, 3) → the picture, encoded;
    floor: (n, 3), the least linear light of the output at n even steps of the picture's least channel, from
    `WHITE_FROM` to 1; to_linear: (3, 3), balanced light to that of the output; highest: where balanced light is
    clipped before it is rendered.
    """

    white: Array
    shown: Callable[[Array], Array]
    floor: Array
    to_linear: Array
    highest: float = 1.0

    def __call__(self, balanced: Array) -> Array:
        """Balanced linear light (…, 3) → the same, no channel of the output lower."""
        least = np.min(self.shown(balanced), axis=-1, keepdims=True)
        nearness = np.clip((least - WHITE_FROM) / (1.0 - WHITE_FROM), 0.0, 1.0)
        least_output = apply_curve(self.floor, np.repeat(nearness, 3, axis=-1))
        missing = least_output - np.minimum(balanced, self.highest) @ self.to_linear.T
        bend = np.maximum(SOFTNESS * least_output * (1.0 - nearness), 1e-9)
        missing = np.where(missing < bend, np.maximum(missing + bend, 0.0) ** 2 / (4.0 * bend), missing)
        # Light outside the gamut of the output is below any floor, so that it has to rise from where it is.
        missing *= 1.0 - (1.0 - nearness) ** 2
        return np.asarray(balanced + missing @ np.linalg.inv(self.to_linear).T)


def neutral_highlights(
    to_balanced: Callable[[Array], Array],
    shown: Callable[[Array], Array],
    render: Callable[[Array], Array],
    level: float,
    to_linear: Array,
    highest: float = 1.0,
) -> NeutralHighlights:
    """Return the stage that keeps white neutral between the two halves of a refinish.

    to_balanced: encoded source → balanced light; shown: the way back; render: balanced light → encoded output; level:
    balanced light of white, if it is no brighter than what just saturates; to_linear, highest: as in
    `NeutralHighlights`.
    """
    codes = np.linspace(0.0, 1.0, 256)
    ramp = to_balanced(codes[:, None].repeat(3, axis=1))
    white = np.maximum(ramp[-1], 1e-6)
    grey = np.minimum(white_as_grey(render, np.minimum(ramp[-1], highest), level, to_linear), highest)

    # Which level of grey light makes which code of each channel of the output, and which source code has which light.
    levels = np.linspace(0.0, 1.0, 1024) ** 2
    rendered = np.maximum.accumulate(render(levels[:, None] * grey))
    least = np.maximum.accumulate(shown(ramp).min(axis=1))
    source = np.interp(np.linspace(WHITE_FROM, 1.0, FLOOR_ENTRIES), least, codes)
    floor = np.empty((FLOOR_ENTRIES, 3))
    for c, full in enumerate(to_linear @ grey):
        output = np.maximum(rendered[-1, c] - RISE * (1.0 - source), 0.0)
        rising = np.concatenate([[True], np.diff(rendered[:, c]) > 1e-6])
        floor[:, c] = np.interp(output, rendered[rising, c], levels[rising]) * full
    floor[-1] = to_linear @ grey
    return NeutralHighlights(white, shown, floor, to_linear, highest)


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
