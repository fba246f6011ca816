"""Drawings as matplotlib's figures, written as SVG and PNG."""

import re
from io import StringIO
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lutforge.arrays import Pixels
from lutforge.atomic_write import atomic_path
from lutforge.model.camera_profile import CameraProfile
from lutforge.reports import figures

SHEET_DPI = 100
"""Pixels per inch of the sheets; a point of text is 1/72 inch."""

MARKERS = {"circle": "o", "x": "x", "cross": "+"}


def figure_of(drawing: figures.Drawing) -> Figure:
    """Draw all panels; a row has one colour bar, that of its last panel with a scale's name."""
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
            values = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(*scaled[-1][1].scale), figures.MAP)
            beside = [axis for axis, _ in scaled]
            figure.colorbar(values, ax=beside, label=scaled[-1][1].scale_name, extend="max", shrink=0.8, aspect=20)
    return figure


def _draw(axis: Axes, mark: figures.Mark, scale: tuple[float, float]) -> None:
    low, high = scale
    match mark:
        case figures.Line():
            axis.plot(mark.x, mark.y, color=mark.colour, linestyle=mark.dash, linewidth=mark.width, label=mark.label)
        case figures.Lines():
            axis.add_collection(LineCollection(list(mark.curves), colors=mark.colour, linewidths=0.6, alpha=0.8))
            axis.autoscale()
        case figures.Dots():
            of_scale: dict[str, Any] = {} if mark.values is None else {"cmap": figures.MAP, "vmin": low, "vmax": high}
            x, y = mark.points.T
            axis.scatter(
                x, y, c=mark.colour if mark.values is None else mark.values, s=mark.size**2 / 2,
                marker=MARKERS[mark.marker], label=mark.label, linewidths=0 if mark.marker == "circle" else 0.8,
                rasterized=len(mark.points) > 100, **of_scale,
            )  # fmt: skip
        case figures.Arrows():
            axis.quiver(
                *mark.start.T, *(mark.end - mark.start).T, mark.values, cmap=figures.MAP, clim=scale, angles="xy",
                scale_units="xy", scale=1, width=0.006, rasterized=True,
            )  # fmt: skip
        case figures.Raster():
            shown = mark.values if mark.values.ndim == 2 else np.clip(mark.values, 0.0, 1.0)
            height, width = mark.values.shape[:2]
            right, top = mark.size or (width, height)
            axis.imshow(
                shown, cmap=figures.MAP, vmin=low, vmax=high, extent=(0, right, 0, top), interpolation="nearest"
            )
            axis.set_facecolor("0.85")
        case figures.Bars():
            width, height = mark.right - mark.left, mark.top - mark.bottom
            axis.bar(
                mark.left, height, width, mark.bottom, align="edge", color=mark.colour, alpha=0.6, label=mark.label
            )


def save_png(figure: Figure, path: str | Path, dpi: float = 100) -> None:
    """Write a figure as PNG, whole or not at all."""
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=dpi, format="png", metadata={"Software": None})  # the same bytes by each version


def to_svg(figure: Figure) -> str:
    """A figure as an <svg> element, without an XML head, the same bytes each time."""
    # Text stays text, and ids are made from the content alone.
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "lutforge"}), StringIO() as buffer:
        figure.savefig(buffer, format="svg", metadata={"Date": None, "Creator": None}, dpi=144)
        text = buffer.getvalue()
    # An image is named by its content, and two scales of colours are the same image: nothing refers to these names.
    return re.sub(r' id="image[0-9a-f]+"', "", text[text.index("<svg") :])


# --- Two sheets for people who look rather than read -----------------------------------------------------------------


def refinish_sheet(
    before: Pixels, after: Pixels, target: Pixels, path: str | Path, titles: tuple[str, str, str]
) -> None:
    """The photograph, the graded one, and its target, each (h, w, 3), and the error of the graded, as one PNG.

    The four lie on a grid that fills the page, each below its title; the scale of the error stands in its panel.
    """
    height, width = before.shape[:2]
    error = np.linalg.norm(after.astype(np.float64) - target, axis=-1)
    last = f"the error that is left (1 = full scale), RMSE {np.sqrt(np.mean((after - target) ** 2)):.4f}"
    panels = zip((*titles, last), (before, after, target, error), strict=True)

    # In pixels: a picture is half of the page wide, and its title stands above it.
    gap, title_height, picture_width = 8, 28, 600
    picture_height = round(picture_width * height / width)
    page_width, page_height = 2 * picture_width + 3 * gap, 2 * (picture_height + title_height + gap) + gap
    figure = Figure(figsize=(page_width / SHEET_DPI, page_height / SHEET_DPI))
    for index, (title, values) in enumerate(panels):
        left = gap + (index % 2) * (picture_width + gap)
        bottom = gap + (1 - index // 2) * (picture_height + title_height + gap)
        place = (left / page_width, bottom / page_height, picture_width / page_width, picture_height / page_height)
        axis = figure.add_axes(place)
        axis.imshow(values, cmap=figures.MAP, vmin=0.0, vmax=figures.ERROR_SCALE, aspect="auto")
        axis.set_title(title, fontsize=12, pad=6)
        axis.set_axis_off()

    bar = axis.inset_axes((0.64, 0.9, 0.32, 0.04))
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0.0, figures.ERROR_SCALE), figures.MAP)
    marks = figure.colorbar(scale, cax=bar, orientation="horizontal", ticks=(0.0, figures.ERROR_SCALE))
    bar.tick_params(colors="white", labelsize=10)
    marks.outline.set_edgecolor("white")
    save_png(figure, path, SHEET_DPI)


def calibration_sheet(profile: CameraProfile, style: str, path: str | Path) -> None:
    """Node levels of both lattices, the grey axis through them, and where samples support the nodes, as one PNG."""
    chosen = profile.styles[style]
    figure = figure_of(figures.lattice_figure(chosen, list(chosen.lattices)))
    figure.suptitle(f"{profile.camera}, style {style}: above render, below linearize")
    save_png(figure, path, dpi=133)
