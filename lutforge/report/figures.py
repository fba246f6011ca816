"""What all figures share, and those of samples, errors and responses."""

from collections.abc import Sequence
from io import StringIO
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.calibration.physical.brightness_transfer import TransferFunction
from lutforge.colour.colour_difference import srgb_to_lab
from lutforge.colour.srgb import SRGB_TO_XYZ, srgb_encode
from lutforge.evaluation.errors_table import ErrorFigures
from lutforge.model.emor import mean_response
from lutforge.model.profile_data import PictureStyle

CHANNELS = (("R", "#c23b22", "-"), ("G", "#2e8b57", "--"), ("B", "#2f5fb3", ":"))
"""Name, colour and line style: the line style tells the channels apart where the colours do not."""
MAP = "cividis"
"""The colour scale of maps: even in lightness, the same to colour-blind eyes."""
ERROR_SCALE = 0.1
"""The error that is drawn brightest, as a norm of RGB, 1 = full scale."""


def save_png(figure: Figure, path: str | Path, dpi: float = 100) -> None:
    """Write a figure as PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png")


def to_svg(figure: Figure) -> str:
    """A figure as an <svg> element, without an XML head, the same bytes each time."""
    # Text stays text, and ids are made from the content alone.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "lutforge"}), StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=144)
        text = buffer.getvalue()
    return text[text.index("<svg") :]


def chromaticity_outlines() -> tuple[Array, Array]:
    """The spectrum locus and sRGB's triangle in CIE 1931 xy, both closed, (m, 2)."""
    import colour  # imported here: it takes a second, and most commands never need it

    spectrum = colour.XYZ_to_xy(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].values)
    primaries = colour.RGB_COLOURSPACES["sRGB"].primaries
    return np.vstack([spectrum, spectrum[:1]]), np.vstack([primaries, primaries[:1]])


def chromaticity_figure(encoded: Array) -> Figure:
    """JPEG colours (n, 3) in the CIE 1931 xy diagram, each in its own colour, and L* over chroma beside it."""
    import colour

    chosen = encoded[_thinned(len(encoded))]
    xy = colour.XYZ_to_xy(colour.models.eotf_sRGB(chosen) @ SRGB_TO_XYZ.T)
    spectrum, triangle = chromaticity_outlines()
    lab = srgb_to_lab(chosen)
    figure = Figure(figsize=(9, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(*spectrum.T, color="0.5", linewidth=0.8, label="spectrum")
    left.plot(*triangle.T, color="black", linewidth=0.8, label="sRGB")
    left.scatter(*xy.T, c=chosen, s=5, linewidths=0, rasterized=True)
    left.set(title="chromaticity", xlabel="x", ylabel="y", aspect="equal")
    left.legend(frameon=False)
    right.scatter(np.hypot(lab[:, 1], lab[:, 2]), lab[:, 0], c=chosen, s=5, linewidths=0, rasterized=True)
    right.set(title="lightness and chroma", xlabel="C*", ylabel="L*", ylim=(0, 100))
    return figure


def error_by_colour_figure(encoded: Array, error: Array) -> Figure:
    """Held-out error (n,) of JPEG colours (n, 3) over a* b* and over lightness: which colours are predicted badly."""
    order = np.argsort(error)
    chosen = order[_thinned(len(order))]  # the largest errors on top
    lab = srgb_to_lab(encoded[chosen])
    figure = Figure(figsize=(9, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    drawn = left.scatter(
        lab[:, 1], lab[:, 2], c=error[chosen], s=7, cmap=MAP, vmin=0, vmax=ERROR_SCALE, linewidths=0, rasterized=True
    )
    left.set(title="error over hue and chroma", xlabel="a* (green – red)", ylabel="b* (blue – yellow)", aspect="equal")
    right.scatter(lab[:, 0], error[chosen], c=encoded[chosen], s=7, linewidths=0, rasterized=True)
    right.set(title="error over lightness", xlabel="L*", ylabel="RGB error, 1 = full scale", ylim=(0, None))
    figure.colorbar(drawn, ax=left, extend="max", shrink=0.8)
    return figure


def _thinned(count: int) -> NDArray[np.intp]:
    """Choose at most 6,000 rows of `count`, at random: the figure stays small, and points no longer hide each other."""
    return np.sort(np.random.default_rng(0).permutation(count)[:6000])


def error_boxes(directions: Sequence[tuple[str, Sequence[tuple[str, ErrorFigures]]]], own: str) -> Figure:
    """Draw errors as boxes on a logarithmic scale. directions: a title and figures by method; `own` is in colour."""
    rows = max(len(methods) for _, methods in directions)
    figure = Figure(figsize=(9, 1.0 + 0.36 * rows), layout="constrained")
    for axis, (title, methods) in zip(figure.subplots(1, len(directions), squeeze=False)[0], directions, strict=True):
        for position, (name, values) in enumerate(reversed(methods)):
            colour = "#2f5fb3" if name == own else "0.6"
            axis.plot((values.q3, values.maximum), (position, position), color=colour, linewidth=0.8)
            axis.barh(position, values.q3 - values.q1, left=values.q1, height=0.55, color=colour, alpha=0.75)
            axis.plot((values.median, values.median), (position - 0.27, position + 0.27), color="white", linewidth=1.5)
            axis.plot(values.mean, position, "D", color="black", markersize=4)
            axis.plot(values.maximum, position, "|", color=colour, markersize=9)
            axis.text(values.mean, position + 0.33, f"{values.mean:.4f}", ha="center", va="bottom", fontsize=7)
        axis.set_yticks(range(len(methods)), [name for name, _ in reversed(methods)])
        axis.set(title=title, xscale="log", xlabel="RGB error, 1 = full scale")
        axis.set_ylim(-0.6, len(methods) - 0.2)
        axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0)))
        axis.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.grid(axis="x", color="0.9", linewidth=0.6)
        axis.set_axisbelow(True)
    return figure


def response_figure(style: PictureStyle) -> Figure:
    """f per channel over the linear value and over stops below saturation, with EMoR's mean and sRGB's curve."""
    linear = np.concatenate([np.linspace(0, 1, 513)[1:], 2.0 ** np.linspace(-8, 0, 257)])
    linear.sort()
    curves, mean, srgb = style.tones(linear), mean_response(linear), srgb_encode(linear)
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
    figure.axes[1].set_xlim(-8, 0)
    figure.axes[0].legend(frameon=False, loc="lower right")
    return figure


def brightness_transfer_figure(functions: Sequence[TransferFunction]) -> Figure:
    """JPEG values of the longer exposure over those of the shorter, per channel, with τ of each ratio (thesis, 3.1).

    Dashed: τ of a response that was fitted without the removal of outliers (Fig. 4.2).
    """
    figure = Figure(figsize=(9, 3.4), layout="constrained")
    for channel, axis in enumerate(figure.subplots(1, 3)):
        for index, function in enumerate(functions):
            colour = f"C{index % 10}"
            for rows, marker in ((~function.outlier, "."), (function.outlier, "x")):
                x, y = function.first[rows, channel], function.second[rows, channel]
                some = _thinned(len(x))
                axis.plot(x[some], y[some], marker, color=colour, markersize=3, alpha=0.5, rasterized=True)
            even = np.linspace(0, 1, len(function.curve))
            axis.plot(even, function.curve[:, channel], color=colour, label=f"{function.stops:+.1f} stops")
            axis.plot(even, function.of_all[:, channel], "--", color=colour, linewidth=0.8)
        axis.set(title=CHANNELS[channel][0], xlabel="shorter exposure", ylabel="longer exposure", aspect="equal")
    figure.axes[0].legend(frameon=False, fontsize=8)
    return figure
