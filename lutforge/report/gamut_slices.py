"""The gamut map h as slices of constant luminance: arrows from the colour before it to the colour after (Fig. 4.4)."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.colour.srgb import SRGB_TO_XYZ
from lutforge.model.gamut_map import GamutMap
from lutforge.report.figures import MAP

LUMINANCE = SRGB_TO_XYZ[1]
"""Weights of linear sRGB's channels in Y."""


@dataclass(frozen=True, eq=False)
class GamutSlice:
    """h on one plane of luminance Y, over R − Y and B − Y in linear sRGB.

    before, after: (n, 2); change: (n,) the distance that h moves the colour in R³; control_points: (m, 2) near it.
    """

    luminance: float
    before: Array
    after: Array
    change: Array
    control_points: Array


def gamut_slice(gamut_map: GamutMap, luminance: float, grid: int = 25) -> GamutSlice:
    """h at the colours of linear sRGB's cube that have this luminance."""
    axis = np.linspace(0.0, 1.0, grid)
    red, blue = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    green = (luminance - LUMINANCE[0] * red - LUMINANCE[2] * blue) / LUMINANCE[1]
    inside = (green >= 0) & (green <= 1)
    before = np.stack([red, green, blue], axis=1)[inside]
    after = gamut_map(before) if len(before) else before
    return GamutSlice(
        luminance,
        _on_plane(before),
        _on_plane(after),
        np.linalg.norm(after - before, axis=1),
        _on_plane(centres_near(gamut_map, luminance)),
    )


def centres_near(gamut_map: GamutMap, luminance: float) -> Array:
    """The control points (m, 3) of h that lie near this luminance."""
    near = np.abs(gamut_map.centres @ LUMINANCE - luminance) < 0.04
    return np.asarray(gamut_map.centres[near])


def gamut_figure(maps: dict[str, GamutMap]) -> Figure:
    """A row of slices per style, several styles one below the other."""
    figure, levels = Figure(figsize=(9, 3.1 * len(maps)), layout="constrained"), (0.08, 0.25, 0.5)
    axes = figure.subplots(len(maps), len(levels), squeeze=False)
    slices = {style: [gamut_slice(gamut_map, level) for level in levels] for style, gamut_map in maps.items()}
    top = max([0.02, *(float(one.change.max()) for row in slices.values() for one in row if len(one.change))])
    drawn = None
    for row, (style, ones) in zip(axes, slices.items(), strict=True):
        for axis, one in zip(row, ones, strict=True):
            step = one.after - one.before
            drawn = axis.quiver(
                *one.before.T,
                *step.T,
                one.change,
                cmap=MAP,
                clim=(0, top),
                angles="xy",
                scale_units="xy",
                scale=1,
                width=0.006,
                rasterized=True,
            )
            axis.plot(*one.control_points.T, ".", color="#c23b22", markersize=2, label="control points")
            axis.plot(0, 0, "+", color="black")
            axis.set(title=f"{style}, Y = {one.luminance:g}", xlabel="R − Y", ylabel="B − Y", aspect="equal")
    figure.legend(*axes[0, 1].get_legend_handles_labels(), loc="outside lower left", frameon=False)
    if drawn is not None:
        figure.colorbar(drawn, ax=axes, shrink=0.7, label="change, linear, 1 = full scale")
    return figure


def _on_plane(colours: Array) -> Array:
    luminance = colours @ LUMINANCE
    return np.stack([colours[:, 0] - luminance, colours[:, 2] - luminance], axis=1)
