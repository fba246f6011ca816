"""Pictures of the samples: where their colours lie, and which of them a calibration gets wrong."""

import numpy as np
from matplotlib.figure import Figure

from lutforge.arrays import Array
from lutforge.colour.colour_difference import srgb_to_lab
from lutforge.report.drawing import ERROR_SCALE, MAP

MOST_POINTS = 6000
"""More are thinned at random: the figure stays small, and points no longer hide each other."""


def chromaticity_figure(encoded: Array) -> Figure:
    """JPEG colours (n, 3) in the CIE 1931 xy diagram, each in its own colour, and L* over chroma beside it."""
    import colour  # imported here: it takes a second, and most commands never need it

    chosen = _thinned(encoded)
    space = colour.RGB_COLOURSPACES["sRGB"]
    xy = colour.XYZ_to_xy(colour.models.eotf_sRGB(chosen) @ space.matrix_RGB_to_XYZ.T)
    spectrum = colour.XYZ_to_xy(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].values)
    lab = srgb_to_lab(chosen)
    figure = Figure(figsize=(9, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    left.plot(*np.vstack([spectrum, spectrum[:1]]).T, color="0.5", linewidth=0.8, label="spectrum")
    left.plot(*np.vstack([space.primaries, space.primaries[:1]]).T, color="black", linewidth=0.8, label="sRGB")
    left.scatter(*xy.T, c=chosen, s=5, linewidths=0, rasterized=True)
    left.set(title="chromaticity", xlabel="x", ylabel="y", aspect="equal")
    left.legend(frameon=False)
    right.scatter(np.hypot(lab[:, 1], lab[:, 2]), lab[:, 0], c=chosen, s=5, linewidths=0, rasterized=True)
    right.set(title="lightness and chroma", xlabel="C*", ylabel="L*", ylim=(0, 100))
    return figure


def error_by_colour_figure(encoded: Array, error: Array) -> Figure:
    """Held-out error (n,) of JPEG colours (n, 3) over a* b* and over lightness: which colours are predicted badly."""
    order = np.argsort(error)
    rows = np.sort(np.random.default_rng(0).permutation(len(order))[:MOST_POINTS])
    chosen = order[rows]  # the largest errors on top
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


def _thinned(colours: Array) -> Array:
    rows = np.random.default_rng(0).permutation(len(colours))[:MOST_POINTS]
    return colours[np.sort(rows)]
