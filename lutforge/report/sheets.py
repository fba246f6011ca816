"""Two sheets for people who look rather than read: a refinished photograph, and a calibration."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lutforge.arrays import Pixels
from lutforge.model.camera_profile import CameraProfile
from lutforge.report.figures import ERROR_SCALE, MAP, save_png
from lutforge.report.lattice_figures import lattice_figure


def refinish_sheet(
    before: Pixels, after: Pixels, wanted: Pixels, path: str | Path, titles: tuple[str, str, str]
) -> None:
    """The photograph, the graded one, what it should be, and the error between the last two, as one PNG.

    Pixels: (h, w, 3), encoded, the same size.
    """
    height, width = before.shape[:2]
    figure = Figure(figsize=(12, 12 * height / width + 0.9), layout="constrained")
    error = np.linalg.norm(after.astype(np.float64) - wanted, axis=-1)
    axes = figure.subplots(2, 2).ravel()
    for axis, image, title in zip(axes, (before, after, wanted), titles, strict=False):
        _picture(axis, title).imshow(np.clip(image, 0, 1), interpolation="antialiased")
    panel = _picture(axes[3], f"RGB error of the graded photograph, RMSE {np.sqrt(np.mean((after - wanted) ** 2)):.4f}")
    drawn = panel.imshow(error, cmap=MAP, vmin=0, vmax=ERROR_SCALE)
    scale = panel.inset_axes((0.66, 0.93, 0.31, 0.035))
    figure.colorbar(drawn, cax=scale, orientation="horizontal", ticks=[0, ERROR_SCALE])
    scale.tick_params(colors="white", labelsize=9)
    save_png(figure, path)


def calibration_sheet(profile: CameraProfile, style: str, path: str | Path) -> None:
    """Node levels of both lattices, the grey axis through them, and where samples support the nodes, as one PNG."""
    chosen = profile.styles[style]
    figure = lattice_figure(chosen, list(chosen.lattices))
    figure.suptitle(f"{profile.camera}, style {style}: above render, below linearize")
    save_png(figure, path, dpi=133)


def _picture(axis: Axes, title: str) -> Axes:
    axis.set_title(title, fontsize=11)
    axis.set_axis_off()
    return axis
