"""The figures of a profile, its samples and its errors, as drawings (`drawing`): what each shows, and where from."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.bracket import BracketFit
from lutforge.calibration.brightness_transfer import TransferFunction
from lutforge.colour.srgb import SRGB_TO_XYZ, chromaticities, srgb_decode, srgb_encode, srgb_to_lab
from lutforge.model.emor import mean_response
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.profile import Direction, PictureStyle
from lutforge.reports.drawing import (
    CHANNELS,
    ERROR_SCALE,
    GREY,
    Arrows,
    Bars,
    Dots,
    Drawing,
    Line,
    Lines,
    Mark,
    Panel,
    Raster,
    thinned,
)

ENDS = {"render": ("RAW after white balance", "JPEG"), "linearize": ("JPEG", "RAW after white balance")}
"""The input and the output of each direction, in words."""
LUMINANCE = SRGB_TO_XYZ[1]
"""The weights of linear sRGB's channels in Y."""


def chromaticity_outlines() -> tuple[Array, Array]:
    """The spectrum locus and sRGB's triangle in CIE 1931 xy, both closed, (m, 2)."""
    import colour  # imported here: it takes a second, and most commands never need it

    spectrum = colour.XYZ_to_xy(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].values)
    primaries = colour.RGB_COLOURSPACES["sRGB"].primaries
    return np.vstack([spectrum, spectrum[:1]]), np.vstack([primaries, primaries[:1]])


def chromaticity_figure(encoded: Array) -> Drawing:
    """JPEG colours (n, 3) in the CIE 1931 xy diagram, each in its own colour; in a second panel L* over chroma."""
    colours = encoded[thinned(len(encoded))]
    spectrum, triangle = chromaticity_outlines()
    lab = srgb_to_lab(colours)
    diagram = (
        Line(spectrum[:, 0], spectrum[:, 1], width=0.8, label="spectrum"),
        Line(triangle[:, 0], triangle[:, 1], colour="#000000", width=0.8, label="sRGB"),
        Dots(chromaticities(srgb_decode(colours)), colours, size=3),
    )
    chroma = np.column_stack([np.hypot(lab[:, 1], lab[:, 2]), lab[:, 0]])
    lightness = Panel("lightness and chroma", (Dots(chroma, colours, size=3),), "C*", "L*", y_range=(0, 100))
    return Drawing(((Panel("chromaticity", diagram, "x", "y", equal=True), lightness),), 3.8)


def error_by_colour_figure(encoded: Array, error: Array) -> Drawing:
    """Held-out error (n,) of JPEG colours (n, 3) over a* b* and over lightness: which colours are predicted badly."""
    order = np.argsort(error)[thinned(len(error))]  # the largest are drawn last, on top
    lab = srgb_to_lab(encoded[order])
    error = error[order]
    name = "RGB error, 1 = full scale"
    by_hue = Panel(
        "error over hue and chroma",
        (Dots(lab[:, 1:], values=error, size=4),),
        "a* (green – red)",
        "b* (blue – yellow)",
        equal=True,
        scale=(0.0, ERROR_SCALE),
        scale_name=name,
    )
    dots = Dots(np.column_stack([lab[:, 0], error]), encoded[order], size=4)
    return Drawing(((by_hue, Panel("error over lightness", (dots,), "L*", name)),), 3.8)


def brightness_transfer_figure(functions: Sequence[TransferFunction]) -> Drawing:
    """JPEG values of the longer exposure over those of the shorter, per channel, with τ of each ratio (thesis, 3.1).

    Dashed: τ of a response that was fitted without the removal of outliers (Fig. 4.2).
    """
    colours = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9")
    panels = []
    for channel, (name, _, _) in enumerate(CHANNELS):
        marks: list[Mark] = []
        for index, function in enumerate(functions):
            colour = colours[index % len(colours)]
            for rows, marker in ((~function.outlier, "circle"), (function.outlier, "x")):
                points = np.column_stack([function.first[rows, channel], function.second[rows, channel]])
                marks.append(Dots(points[thinned(len(points))], colour, marker=marker, size=2))
            even = np.linspace(0, 1, len(function.curve))
            label = f"{function.stops:+.1f} stops" if channel == 0 else ""
            marks.append(Line(even, function.curve[:, channel], colour, label=label))
            marks.append(Line(even, function.curve_with_outliers[:, channel], colour, "dashed", 0.8))
        panels.append(Panel(name, tuple(marks), "shorter exposure", "longer exposure", equal=True))
    return Drawing((tuple(panels),))


def response_figure(style: PictureStyle) -> Drawing:
    """f per channel over the linear value and over stops below saturation, with EMoR's mean and sRGB's curve."""
    linear = np.concatenate([np.linspace(0, 1, 513)[1:], 2.0 ** np.linspace(-8, 0, 257)])
    linear.sort()
    curves = style.tones(linear)
    emor_mean = mean_response(linear)
    title = "The response f" if style.models else "The grey axis of the lattice"
    panels = []
    for x, label, x_range in (
        (linear, "linear value, 1 = saturation", (0.0, 1.0)),
        (np.log2(linear), "stops below saturation", (-8.0, 0.0)),
    ):
        mean_line = Line(x, emor_mean, GREY, "dotted", 1.0, "mean of 201 responses (EMoR)")
        marks = (mean_line, Line(x, srgb_encode(linear), label="sRGB", width=1.0), *_of_channels(x, curves))
        panels.append(Panel(title, marks, label, "JPEG value", x_range, (0.0, 1.02)))
    return Drawing((tuple(panels),))


def bracket_figure(fit: BracketFit) -> Drawing:
    """The response of a bracket, per channel, with sRGB's curve."""
    linear = np.linspace(0.0, 1.0, 257)
    values = fit.response.encode(np.repeat(linear[:, None], 3, axis=1))
    marks = (Line(linear, srgb_encode(linear), label="sRGB", width=1.0), *_of_channels(linear, values))
    labels = "linear value, 1 = saturation", "JPEG value"
    return Drawing(((Panel("The response f", marks, *labels, (0.0, 1.0), (0.0, 1.02)),),))


def _of_channels(x: Array, curves: Array, width: float = 2.0) -> list[Line]:
    """A line for each channel of curves (n, 3) over x (n,)."""
    return [Line(x, curves[:, c], colour, dash, width, name) for c, (name, colour, dash) in enumerate(CHANNELS)]


def cube_edges() -> Array:
    """The twelve edges of sRGB's cube, (12, 2, 3): the linear colours at both ends of each."""
    corners = np.array([[r, g, b] for r in (0.0, 1.0) for g in (0.0, 1.0) for b in (0.0, 1.0)])
    pairs = [(i, j) for i in range(8) for j in range(i) if np.abs(corners[i] - corners[j]).sum() == 1]
    return np.asarray(corners[np.array(pairs)])


def slice_grid(luminance: float, rings: int = 17, points: int = 16) -> Array:
    """Cover the slice of the sRGB cube at a luminance 0 < Y < 1 with a grid (rings, n, 3) of linear colours.

    The first ring is the grey of this luminance, the last the slice's outline, closed, with `points` on each side.
    """
    first, second = cube_edges().transpose(1, 0, 2)
    low = first @ LUMINANCE - luminance
    high = second @ LUMINANCE - luminance

    # The corners of the slice, where it cuts edges of the cube, in order around the grey.
    cut = (low < 0) != (high < 0)
    share = (low[cut] / (low[cut] - high[cut]))[:, None]
    corners = first[cut] + share * (second[cut] - first[cut])
    from_grey = corners - luminance
    corners = corners[np.argsort(np.arctan2(from_grey[:, 0] - from_grey[:, 1], from_grey[:, 2] - from_grey[:, 1]))]

    along = np.arange(points)[:, None, None] / points
    sides = corners + along * (np.roll(corners, -1, axis=0) - corners)  # (points, corners, 3)
    outline = np.vstack([sides.transpose(1, 0, 2).reshape(-1, 3), corners[:1]])
    return luminance + np.linspace(0.0, 1.0, rings)[:, None, None] * (outline - luminance)


def centres_near(gamut_map: GamutMap | SolvedInverse, luminance: float) -> Array:
    """The control points (m, 3) of a gamut map with about this luminance; an inverse that is solved has none."""
    if isinstance(gamut_map, SolvedInverse):
        return np.zeros((0, 3))
    return np.asarray(gamut_map.centres[np.abs(gamut_map.centres @ LUMINANCE - luminance) < 0.04])


def gamut_figure(maps: Mapping[str, GamutMap | SolvedInverse], levels: Sequence[float] = (0.08, 0.25, 0.5)) -> Drawing:
    """h in slices of constant luminance (Fig. 4.4): arrows from a colour to its mapped colour; one row for each map.

    The axes are R − Y and B − Y in linear sRGB; the arrows are coloured by the distance of the two colours.
    """
    axis = np.linspace(0.0, 1.0, 25)
    red, blue = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    rows = []
    top = 0.02
    for name, gamut_map in maps.items():
        panels = []
        for level in levels:
            green = (level - LUMINANCE[0] * red - LUMINANCE[2] * blue) / LUMINANCE[1]
            before = np.stack([red, green, blue], axis=1)[(green >= 0) & (green <= 1)]
            after = gamut_map(before) if len(before) else before
            change = np.linalg.norm(after - before, axis=1)
            top = max(top, float(change.max(initial=0.0)))
            marks = (
                Arrows(_on_plane(before), _on_plane(after), change),
                Dots(_on_plane(centres_near(gamut_map, level)), CHANNELS[0][1], size=2),
                Dots(np.zeros((1, 2)), GREY, marker="cross", size=8),
            )
            panels.append(Panel(f"{name}, Y = {level:.2f}", marks, "R − Y", "B − Y", equal=True))
        rows.append(panels)
    name = "change, linear, 1 = full scale"
    scaled = tuple(tuple(replace(panel, scale=(0.0, top), scale_name=name) for panel in row) for row in rows)
    return Drawing(scaled, 3.1)


def _on_plane(colours: Array) -> Array:
    """R − Y and B − Y (n, 2) of linear colours (n, 3)."""
    return np.asarray(colours[:, [0, 2]] - (colours @ LUMINANCE)[:, None])


def lattice_figure(style: PictureStyle, directions: Sequence[Direction]) -> Drawing:
    """Node levels, grey axis and coverage of a style's lattices, a row for each direction.

    Node levels are shown over the cube coordinate: where the curve is flat, nodes are dense. Coverage is log10 of
    1 + the weight of the samples at the nodes, summed along the blue axis.
    """
    grey = np.linspace(0, 1, 512)
    rows = []
    for direction in directions:
        lattice = style.lattices[direction]
        source, target = ENDS[direction]
        curves = _of_channels(grey, lattice(np.repeat(grey[:, None], 3, axis=1)), 1.5)
        levels = [
            Line(np.linspace(0, 1, len(nodes)), nodes, colour, dash, label=name)
            for nodes, (name, colour, dash) in zip(lattice.levels, CHANNELS, strict=True)
        ]
        row = [Panel("node levels", tuple(levels), "cube coordinate", source)]
        row.append(Panel("grey axis", tuple(curves), source, target))
        covered = style.coverage.get(direction)
        if covered is not None:
            weights = np.log10(1 + covered.sum(axis=2)).T[::-1]
            row.append(
                Panel(
                    f"nodes with samples, {float((covered > 0).mean()):.0%} of all",
                    (Raster(weights, (1, 1)),),
                    "red node, share",
                    "green node, share",
                    equal=True,
                    scale=(0, max(weights.max(), 1e-6)),
                )
            )
        rows.append(tuple(row))
    return Drawing(tuple(rows), 3.0)


def levels_on_errors(lattice: Lattice, histograms: tuple[Array, Array, Array], source: str) -> Drawing:
    """Node levels over the histogram of the uniform lattice's squared errors, per axis (thesis, Fig. 5.4).

    histograms: per axis (bins,) over [0, 1], bins a multiple of 200.
    """
    edges = np.linspace(0.0, 1.0, 201)
    panels = []
    for levels, histogram, (name, colour, _) in zip(lattice.levels, histograms, CHANNELS, strict=True):
        density = histogram.reshape(200, -1).sum(axis=1)
        marks = (
            Bars(edges[:-1], edges[1:], np.zeros(200), density / max(float(density.max()), 1e-12), colour),
            Lines([np.array([[level, -0.14], [level, -0.02]]) for level in levels]),
        )
        panels.append(Panel(name, marks, source, "error of even nodes", y_range=(-0.2, 1.05)))
    return Drawing((tuple(panels),), 2.6)


def plane_figure(lattice: Lattice, target: str, levels: Mapping[int, float]) -> Drawing:
    """The outputs of three planes of nodes as nets in the other two channels (Fig. A.13). levels: by input channel."""
    panels = []
    for channel, level in levels.items():
        node = int(np.argmin(np.abs(lattice.levels[channel] - level)))
        first, second = (index for index in range(3) if index != channel)
        net = np.take(lattice.values, node, axis=channel)[..., [first, second]]
        marks = (Lines(list(net), CHANNELS[second][1]), Lines(list(net.transpose(1, 0, 2)), CHANNELS[first][1]))
        title = f"nodes at {CHANNELS[channel][0]} = {lattice.levels[channel][node]:.3f}"
        x, y = (f"{target}, {CHANNELS[axis][0]}" for axis in (first, second))
        panels.append(Panel(title, marks, x, y, equal=True))
    return Drawing((tuple(panels),), 3.2)
