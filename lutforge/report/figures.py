"""Pictures of a calibration and of what it does to a photograph."""

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path
from lutforge.model.camera_profile import CameraProfile

Pixels = NDArray[np.float32]
CHANNEL_COLOURS = ("#c23b22", "#2e8b57", "#2f5fb3")
ERROR_SCALE = 0.1
"""The error that is drawn brightest, as a norm of RGB, 1 = full scale."""


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
    drawn = panel.imshow(error, cmap="cividis", vmin=0, vmax=ERROR_SCALE)
    scale = panel.inset_axes((0.66, 0.93, 0.31, 0.035))
    figure.colorbar(drawn, cax=scale, orientation="horizontal", ticks=[0, ERROR_SCALE])
    scale.tick_params(colors="white", labelsize=9)
    _save(figure, path)


def calibration_sheet(profile: CameraProfile, style: str, path: str | Path) -> None:
    """Node levels of both lattices, the grey axis through them, and where samples support the nodes, as one PNG."""
    chosen = profile.styles[style]
    figure = Figure(figsize=(12, 7), layout="constrained")
    figure.suptitle(f"{profile.camera}, style {style}")
    axes = figure.subplots(2, 3)
    names = {"render": ("RAW after white balance", "JPEG"), "linearize": ("JPEG", "RAW after white balance")}
    for row, (direction, (source, target)) in zip(axes, names.items(), strict=True):
        lattice = getattr(chosen, direction)
        if lattice is None:
            continue
        for channel, colour in enumerate(CHANNEL_COLOURS):
            levels = lattice.levels[channel]
            row[0].plot(np.linspace(0, 1, len(levels)), levels, ".-", color=colour, markersize=4)
        row[0].set(title=f"{direction}: node levels", xlabel="cube coordinate", ylabel=source)
        grey = np.linspace(0, 1, 512)
        values = lattice(np.repeat(grey[:, None], 3, axis=1))
        for channel, colour in enumerate(CHANNEL_COLOURS):
            row[1].plot(grey, values[:, channel], color=colour)
        row[1].set(title="grey axis", xlabel=source, ylabel=target)
        _coverage(row[2], chosen.coverage.get(direction), "nodes with samples")
    _save(figure, path)


def _coverage(axis: Axes, coverage: NDArray[np.float64] | None, title: str) -> None:
    if coverage is None:
        axis.set_axis_off()
        return
    seen = np.log10(1 + coverage.sum(axis=2))
    axis.imshow(seen.T, origin="lower", cmap="cividis", extent=(0, 1, 0, 1))
    axis.set(title=title, xlabel="red node, share of the axis", ylabel="green node, share of the axis")


def _picture(axis: Axes, title: str) -> Axes:
    axis.set_title(title, fontsize=11)
    axis.set_axis_off()
    return axis


def _save(figure: Figure, path: str | Path) -> None:
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=100, format="png")
