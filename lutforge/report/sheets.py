"""Two sheets for people who look rather than read: a refinished photograph, and a calibration."""

from pathlib import Path

import numpy as np

from lutforge.arrays import Pixels
from lutforge.model.camera_profile import CameraProfile
from lutforge.report.drawing import ERROR_SCALE, Drawing, Panel, Raster
from lutforge.report.figures import lattice_figure
from lutforge.report.matplotlib_figure import figure_of, save_png


def refinish_sheet(
    before: Pixels, after: Pixels, wanted: Pixels, path: str | Path, titles: tuple[str, str, str]
) -> None:
    """The photograph, the graded one, what it should be, and the error between the last two, as one PNG.

    Pixels: (h, w, 3), encoded, the same size.
    """
    height, width = before.shape[:2]
    error = np.linalg.norm(after.astype(np.float64) - wanted, axis=-1)
    told = f"RGB error of the graded photograph, RMSE {np.sqrt(np.mean((after - wanted) ** 2)):.4f}"
    panels = [
        Panel(title, (Raster(np.asarray(image, dtype=np.float64)),), bare=True, equal=True)
        for title, image in zip(titles, (before, after, wanted), strict=True)
    ]
    panels.append(
        Panel(told, (Raster(error),), bare=True, equal=True, scale=(0.0, ERROR_SCALE), scale_name="norm of RGB")
    )
    rows = (tuple(panels[:2]), tuple(panels[2:]))
    save_png(figure_of(Drawing(rows, 6 * height / width + 0.4, 12.0)), path)


def calibration_sheet(profile: CameraProfile, style: str, path: str | Path) -> None:
    """Node levels of both lattices, the grey axis through them, and where samples support the nodes, as one PNG."""
    chosen = profile.styles[style]
    figure = figure_of(lattice_figure(chosen, list(chosen.lattices)))
    figure.suptitle(f"{profile.camera}, style {style}: above render, below linearize")
    save_png(figure, path, dpi=133)
