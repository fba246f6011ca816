"""Sheets: single PNG files on one refinished photograph, or on the lattices of one style."""

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Single
from lutforge.model.camera_profile import CameraProfile
from lutforge.reports.drawing import ERROR_SCALE, MAP
from lutforge.reports.figures import lattice_figure
from lutforge.reports.matplotlib_figure import figure_of, save_png

SHEET_DPI = 100
"""Pixels per inch of the sheets; a point of text is 1/72 inch."""


def refinish_sheet(
    before: Single, after: Single, target: Single, path: str | Path, titles: tuple[str, str, str]
) -> None:
    """Write one PNG of a photograph, the graded one, and its target, each (h, w, 3), and the error of the graded one.

    The four fill the page, each below its title; the scale of the error is in its panel.
    """
    height, width = before.shape[:2]
    error = np.linalg.norm(after.astype(np.float64) - target, axis=-1)
    error_title = f"the error that is left (1 = full scale), RMSE {np.sqrt(np.mean((after - target) ** 2)):.4f}"
    panels = zip((*titles, error_title), (before, after, target, error), strict=True)

    # Lengths in pixels: two pictures side by side, with gaps, and a title above each.
    gap = 8
    title_height = 28
    picture_width = 600
    picture_height = round(picture_width * height / width)
    page_width = 2 * picture_width + 3 * gap
    page_height = 2 * (picture_height + title_height + gap) + gap
    figure = Figure(figsize=(page_width / SHEET_DPI, page_height / SHEET_DPI))
    for index, (title, values) in enumerate(panels):
        left = gap + (index % 2) * (picture_width + gap)
        bottom = gap + (1 - index // 2) * (picture_height + title_height + gap)
        place = (left / page_width, bottom / page_height, picture_width / page_width, picture_height / page_height)
        axis = figure.add_axes(place)
        axis.imshow(values, cmap=MAP, vmin=0.0, vmax=ERROR_SCALE, aspect="auto")
        axis.set_title(title, fontsize=12, pad=6)
        axis.set_axis_off()

    bar = axis.inset_axes((0.64, 0.9, 0.32, 0.04))
    scale = matplotlib.cm.ScalarMappable(matplotlib.colors.Normalize(0.0, ERROR_SCALE), MAP)
    marks = figure.colorbar(scale, cax=bar, orientation="horizontal", ticks=(0.0, ERROR_SCALE))
    bar.tick_params(colors="white", labelsize=10)
    marks.outline.set_edgecolor("white")
    save_png(figure, path, SHEET_DPI)


def calibration_sheet(profile: CameraProfile, style: str, path: str | Path) -> None:
    """Write one PNG of the node levels, the grey axis and the coverage of a style's lattices."""
    picture_style = profile.styles[style]
    figure = figure_of(lattice_figure(picture_style, list(picture_style.lattices)))
    figure.suptitle(f"{profile.camera}, style {style}: above render, below linearize")
    save_png(figure, path, dpi=133)
