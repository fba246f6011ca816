"""Drawings (`drawing`) as matplotlib's figures, written as SVG and PNG."""

import re
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lutforge.atomic_write import atomic_path
from lutforge.reports.drawing import MAP, Arrows, Bars, Dots, Drawing, Line, Lines, Mark, Raster

MARKERS = {"circle": "o", "x": "x", "cross": "+"}


def figure_of(drawing: Drawing) -> Figure:
    """Draw all panels; a row has one colour bar, that of its last panel whose scale has a name."""
    columns = max(map(len, drawing.rows))
    height = drawing.height * len(drawing.rows)
    figure = Figure(figsize=(drawing.width, height), layout="constrained")
    axes = figure.subplots(len(drawing.rows), columns, squeeze=False)
    for row, panels in zip(axes, drawing.rows, strict=True):
        for axis in row[len(panels) :]:
            axis.set_axis_off()
        for axis, panel in zip(row, panels, strict=False):
            for mark in panel.marks:
                _draw(axis, mark, panel.scale)
            axis.set_title(panel.title, fontsize=8 if panel.bare else 10)
            axis.set(xlabel=panel.x, ylabel=panel.y)
            if panel.x_range is not None:
                axis.set_xlim(*panel.x_range)
            if panel.y_range is not None:
                axis.set_ylim(*panel.y_range)
            if panel.equal:
                axis.set_aspect("equal")
            if panel.bare:
                axis.set(xticks=[], yticks=[])
                axis.spines[:].set_visible(False)
            if any(getattr(mark, "label", "") for mark in panel.marks):
                axis.legend(frameon=False, fontsize=8)
        scaled = [(axis, panel) for axis, panel in zip(row, panels, strict=False) if panel.scale_name]
        if scaled:
            values = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(*scaled[-1][1].scale), MAP)
            scaled_axes = [axis for axis, _ in scaled]
            figure.colorbar(values, ax=scaled_axes, label=scaled[-1][1].scale_name, extend="max", shrink=0.8, aspect=20)
    return figure


def _draw(axis: Axes, mark: Mark, scale: tuple[float, float]) -> None:
    """Draw a mark on a pair of axes. scale: the lowest and the highest value of the colours."""
    low, high = scale
    match mark:
        case Line():
            axis.plot(mark.x, mark.y, color=mark.colour, linestyle=mark.dash, linewidth=mark.width, label=mark.label)
        case Lines():
            axis.add_collection(LineCollection(list(mark.curves), colors=mark.colour, linewidths=0.6, alpha=0.8))
            axis.autoscale()
        case Dots():
            of_scale: dict[str, Any] = {} if mark.values is None else {"cmap": MAP, "vmin": low, "vmax": high}
            x, y = mark.points.T
            axis.scatter(
                x, y, c=mark.colour if mark.values is None else mark.values, s=mark.size**2 / 2,
                marker=MARKERS[mark.marker], label=mark.label, linewidths=0 if mark.marker == "circle" else 0.8,
                rasterized=len(mark.points) > 100, **of_scale,
            )  # fmt: skip
        case Arrows():
            axis.quiver(
                *mark.start.T, *(mark.end - mark.start).T, mark.values, cmap=MAP, clim=scale, angles="xy",
                scale_units="xy", scale=1, width=0.006, rasterized=True,
            )  # fmt: skip
        case Raster():
            shown = mark.values if mark.values.ndim == 2 else np.clip(mark.values, 0.0, 1.0)
            height, width = mark.values.shape[:2]
            right, top = mark.size or (width, height)
            axis.imshow(shown, cmap=MAP, vmin=low, vmax=high, extent=(0, right, 0, top), interpolation="nearest")
            axis.set_facecolor("0.85")
        case Bars():
            width = mark.right - mark.left
            height = mark.top - mark.bottom
            axis.bar(
                mark.left, height, width, mark.bottom, align="edge", color=mark.colour, alpha=0.6, label=mark.label
            )


def save_png(figure: Figure, path: str | Path, dpi: float = 100) -> None:
    """Write a figure as PNG, atomically."""
    with atomic_path(path) as temporary:
        # Without matplotlib's version, so that the same figure gives the same bytes.
        figure.savefig(temporary, dpi=dpi, format="png", metadata={"Software": None})


def to_svg(figure: Figure) -> str:
    """A figure as an <svg> element, without an XML head; the same figure gives the same bytes."""
    # Text is not converted to outlines, and ids depend on the content only.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "lutforge"}), StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=144)
        text = buffer.getvalue()
    # The id of an image depends on its content, and the images of two colour bars are equal; no element refers to it.
    return re.sub(r' id="image[0-9a-f]+"', "", text[text.index("<svg") :])
