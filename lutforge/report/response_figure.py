"""The responses of a style, f: linear → encoded, beside the curves that people know."""

import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.colour.srgb import srgb_encode
from lutforge.model.emor import inverse_emor
from lutforge.model.profile_data import PictureStyle
from lutforge.report.drawing import CHANNELS

STOPS = (-8, 0)


def response_figure(style: PictureStyle) -> Figure:
    """f per channel over the linear value and over stops below saturation, with EMoR's mean and sRGB's curve.

    A style without a physical model shows the grey axis of its lattice, which is f where h leaves grey alone.
    """
    linear = np.concatenate([np.linspace(0, 1, 513)[1:], 2.0 ** np.linspace(*STOPS, 257)])
    linear.sort()
    curves = _curves(style, linear)
    codes = np.linspace(0, 1, 1024)
    mean = np.interp(linear, inverse_emor().mean, codes)
    srgb = srgb_encode(linear)
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    for axis, x, label in zip(
        figure.subplots(1, 2),
        (linear, np.log2(linear)),
        ("linear value, 1 = saturation", "stops below saturation"),
        strict=True,
    ):
        axis.plot(x, mean, color="0.35", linewidth=0.8, dashes=(1, 1.5), label="mean of 201 responses (EMoR)")
        axis.plot(x, srgb, color="0.65", linewidth=1.2, label="sRGB")
        for channel, (name, colour, line) in enumerate(CHANNELS):
            axis.plot(x, curves[:, channel], line, color=colour, label=name)
        axis.set(xlabel=label, ylabel="JPEG value")
    figure.axes[1].set_xlim(*STOPS)
    figure.axes[0].legend(frameon=False, loc="lower right")
    return figure


def _curves(style: PictureStyle, linear: Array) -> Array:
    grey = np.repeat(linear[:, None], 3, axis=1)
    if style.physical:
        return style.physical[0].response.encode(grey)
    if style.render is not None:
        return style.render(grey)
    return np.full_like(grey, np.nan)
