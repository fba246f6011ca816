"""Pictures of a lattice: its node levels, the grey axis through it, where samples support it, where a plane goes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import PictureStyle
from lutforge.report.figures import CHANNELS, MAP

DIRECTIONS = {"render": ("RAW after white balance", "JPEG"), "linearize": ("JPEG", "RAW after white balance")}
"""Per lattice of a style: what goes in, what comes out."""


def _draw_levels(axis: Axes, lattice: Lattice, source: str) -> None:
    """Node level against cube coordinate, per channel: where the curve is flat, nodes are dense."""
    for levels, (name, colour, line) in zip(lattice.levels, CHANNELS, strict=True):
        position = np.linspace(0, 1, len(levels))
        axis.plot(position, levels, line, marker=".", markersize=4, color=colour, label=name)
    axis.set(title="node levels", xlabel="cube coordinate", ylabel=source)
    axis.legend(frameon=False)


def _draw_grey_axis(axis: Axes, lattice: Lattice, source: str, target: str) -> None:
    """What equal channels become."""
    grey = np.linspace(0, 1, 512)
    values = lattice(np.repeat(grey[:, None], 3, axis=1))
    for channel, (name, colour, line) in enumerate(CHANNELS):
        axis.plot(grey, values[:, channel], line, color=colour, label=name)
    axis.set(title="grey axis", xlabel=source, ylabel=target)
    axis.legend(frameon=False)


def _draw_coverage(axis: Axes, coverage: Array | None) -> None:
    """Summed weight of the samples at the nodes, seen along the blue axis."""
    if coverage is None:
        axis.set_axis_off()
        return
    seen = np.log10(1 + coverage.sum(axis=2))
    axis.imshow(seen.T, origin="lower", cmap=MAP, extent=(0, 1, 0, 1))
    axis.set(title="nodes with samples", xlabel="red node, share", ylabel="green node, share")


def levels_on_errors(lattice: Lattice, histograms: tuple[Array, Array, Array], source: str) -> Figure:
    """Node levels over the histogram of the uniform lattice's squared errors, per axis (thesis, Fig. 5.4).

    histograms: per axis (bins,) over [0, 1], bins a multiple of 200.
    """
    figure = Figure(figsize=(9, 2.6), layout="constrained")
    for axis, levels, histogram, (name, colour, _) in zip(
        figure.subplots(1, 3), lattice.levels, histograms, CHANNELS, strict=True
    ):
        density = histogram.reshape(200, -1).sum(axis=1)
        middle = (np.arange(len(density)) + 0.5) / len(density)
        axis.fill_between(middle, density, color=colour, alpha=0.35, linewidth=0)
        top = max(float(density.max()), 1e-9)
        axis.vlines(levels, -0.14 * top, -0.02 * top, color="black", linewidth=0.8)
        axis.axhline(0, color="0.6", linewidth=0.6)
        axis.set(title=f"{name}", xlabel=source, yticks=[])
    figure.supylabel("squared error of a uniform lattice", fontsize=9)
    return figure


def lattice_figure(style: PictureStyle, directions: Sequence[str]) -> Figure:
    """Node levels, grey axis and coverage of a style's lattices, a row for each direction."""
    figure = Figure(figsize=(9, 3.0 * len(directions)), layout="constrained")
    for row, direction in zip(figure.subplots(len(directions), 3, squeeze=False), directions, strict=True):
        lattice, (source, target) = style.lattices[direction], DIRECTIONS[direction]
        _draw_levels(row[0], lattice, source)
        _draw_grey_axis(row[1], lattice, source, target)
        _draw_coverage(row[2], style.coverage.get(direction))
    return figure


def plane_destinations(lattice: Lattice, target: str, level: float = 0.4) -> Figure:
    """Where the nodes of a plane of each input axis go, as a net in the other two output channels (thesis, Fig. A.13).

    level: each plane lies at the node level nearest to this.
    """
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for channel, axis in enumerate(figure.subplots(1, 3)):
        held = int(np.argmin(np.abs(lattice.levels[channel] - level)))
        first, second = (index for index in range(3) if index != channel)
        plane = np.take(lattice.values, held, axis=channel)[..., [first, second]]
        for lines, other in ((plane, second), (plane.transpose(1, 0, 2), first)):
            axis.add_collection(LineCollection(list(lines), colors=CHANNELS[other][1], linewidths=0.6, alpha=0.8))
        axis.set(
            title=f"nodes at {CHANNELS[channel][0]} = {lattice.levels[channel][held]:.2f}",
            xlabel=f"{target}, {CHANNELS[first][0]}",
            ylabel=f"{target}, {CHANNELS[second][0]}",
            aspect="equal",
        )
        axis.autoscale()
    return figure
