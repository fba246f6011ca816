"""Pictures of a lattice: its node levels, the grey axis through it, where samples support it, where a plane goes."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.model.directions import Direction
from lutforge.model.lattice import Lattice
from lutforge.model.profile_data import PictureStyle
from lutforge.report.figures import CHANNELS, MAP

DIRECTIONS = {"render": ("RAW after white balance", "JPEG"), "linearize": ("JPEG", "RAW after white balance")}
"""Per lattice of a style: what goes in, what comes out."""


def plane_net(lattice: Lattice, channel: int, level: float) -> tuple[float, tuple[tuple[int, Array], ...]]:
    """The plane of nodes of an input channel that is nearest to a level: its level, and where its nodes go.

    They go to colours of the other two output channels: a net of lines (k, m, 2) along which the other one rises, and
    of lines along which the one rises, each with the channel that rises.
    """
    held = int(np.argmin(np.abs(lattice.levels[channel] - level)))
    first, second = (index for index in range(3) if index != channel)
    plane = np.take(lattice.values, held, axis=channel)[..., [first, second]]
    return float(lattice.levels[channel][held]), ((second, plane), (first, plane.transpose(1, 0, 2)))


def error_density(histogram: Array) -> tuple[Array, Array]:
    """The middles of 200 bins over [0, 1], and the squared error in each, 1 at most; histogram: (200 k,)."""
    density = histogram.reshape(200, -1).sum(axis=1)
    return (np.arange(200) + 0.5) / 200, density / max(float(density.max()), 1e-12)


def nodes_with_samples(coverage: Array) -> Array:
    """log10 of 1 + the summed weight of the samples at the nodes, seen along the blue axis, (N_g, N_r)."""
    return np.asarray(np.log10(1 + coverage.sum(axis=2)).T)


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
    axis.imshow(nodes_with_samples(coverage), origin="lower", cmap=MAP, extent=(0, 1, 0, 1))
    axis.set(title="nodes with samples", xlabel="red node, share", ylabel="green node, share")


def levels_on_errors(lattice: Lattice, histograms: tuple[Array, Array, Array], source: str) -> Figure:
    """Node levels over the histogram of the uniform lattice's squared errors, per axis (thesis, Fig. 5.4).

    histograms: per axis (bins,) over [0, 1], bins a multiple of 200.
    """
    figure = Figure(figsize=(9, 2.6), layout="constrained")
    for axis, levels, histogram, (name, colour, _) in zip(
        figure.subplots(1, 3), lattice.levels, histograms, CHANNELS, strict=True
    ):
        axis.fill_between(*error_density(histogram), color=colour, alpha=0.35, linewidth=0)
        axis.vlines(levels, -0.14, -0.02, color="black", linewidth=0.8)
        axis.axhline(0, color="0.6", linewidth=0.6)
        axis.set(title=f"{name}", xlabel=source, yticks=[])
    figure.supylabel("squared error of a uniform lattice", fontsize=9)
    return figure


def lattice_figure(style: PictureStyle, directions: Sequence[Direction]) -> Figure:
    """Node levels, grey axis and coverage of a style's lattices, a row for each direction."""
    figure = Figure(figsize=(9, 3.0 * len(directions)), layout="constrained")
    for row, direction in zip(figure.subplots(len(directions), 3, squeeze=False), directions, strict=True):
        lattice, (source, target) = style.lattices[direction], DIRECTIONS[direction]
        _draw_levels(row[0], lattice, source)
        _draw_grey_axis(row[1], lattice, source, target)
        _draw_coverage(row[2], style.coverage.get(direction))
    return figure


def plane_destinations(lattice: Lattice, target: str) -> Figure:
    """Draw, for each input axis, the outputs of a plane of nodes as a net in the other two channels (Fig. A.13)."""
    figure = Figure(figsize=(9, 3.2), layout="constrained")
    for channel, axis in enumerate(figure.subplots(1, 3)):
        level, net = plane_net(lattice, channel, 0.4)
        for along, lines in net:
            axis.add_collection(LineCollection(list(lines), colors=CHANNELS[along][1], linewidths=0.6, alpha=0.8))
        second, first = (CHANNELS[along][0] for along, _ in net)
        axis.set(
            title=f"nodes at {CHANNELS[channel][0]} = {level:.2f}",
            xlabel=f"{target}, {first}",
            ylabel=f"{target}, {second}",
            aspect="equal",
        )
        axis.autoscale()
    return figure
