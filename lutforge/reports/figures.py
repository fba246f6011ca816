"""What figures show, as records: matplotlib draws them in files (`matplotlib_figure`), Bokeh in the studio's page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.bracket import BracketFit
from lutforge.calibration.brightness_transfer import TransferFunction
from lutforge.colour.srgb import SRGB_TO_XYZ, chromaticities, srgb_decode, srgb_encode, srgb_to_lab
from lutforge.model.emor import mean_response
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice
from lutforge.model.profile import Direction, PictureStyle

CHANNELS = (("Red", "#d0432f", "solid"), ("Green", "#2f9e63", "dashed"), ("Blue", "#4f83e0", "dotted"))
"""Name, colour and line style of each channel: the style tells them apart where the colours do not."""
MAP = "cividis"
"""The colour scale of values: even in lightness, the same to colour-blind eyes."""
ERROR_SCALE = 0.1
"""The error that is drawn brightest, as a norm of RGB, 1 = full scale."""
GREY = "#8c8c8c"
"""A grey that stands out from white and from black."""


@dataclass(frozen=True, eq=False)
class Line:
    """A curve through points x, y (n,). label: in the legend, "" for none."""

    x: Array
    y: Array
    colour: str = GREY
    dash: str = "solid"
    width: float = 1.5
    label: str = ""


@dataclass(frozen=True, eq=False)
class Lines:
    """Many curves of one colour, each (k, 2)."""

    curves: Sequence[Array]
    colour: str = GREY


@dataclass(frozen=True, eq=False)
class Dots:
    """Points (n, 2): all in one colour, each in its own encoded RGB (n, 3), or by values (n,) on the panel's scale."""

    points: Array
    colour: str | Array = GREY
    values: Array | None = None
    marker: str = "circle"
    size: float = 4.0
    label: str = ""


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows from points (n, 2) to points (n, 2), coloured by values (n,) on the panel's scale."""

    start: Array
    end: Array
    values: Array


@dataclass(frozen=True, eq=False)
class Raster:
    """A picture (h, w, 3), encoded, or values (h, w) on the panel's scale, grey where NaN; the first row is on top.

    size: its width and height on the axes; None counts pixels.
    """

    values: Array
    size: tuple[float, float] | None = None


@dataclass(frozen=True, eq=False)
class Bars:
    """Rectangles: left, right, bottom, top (n,) each."""

    left: Array
    right: Array
    bottom: Array
    top: Array
    colour: str = GREY
    label: str = ""


Mark = Line | Lines | Dots | Arrows | Raster | Bars


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes with marks.

    x_range, y_range: None: as wide as the marks; equal: one unit is as long on both axes; scale: of the values that
    colours stand for, (low, high), and in words what they are, "" for no colour bar; bare: without axes.
    """

    title: str
    marks: tuple[Mark, ...]
    x: str = ""
    y: str = ""
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    equal: bool = False
    scale: tuple[float, float] = (0.0, 1.0)
    scale_name: str = ""
    bare: bool = False


@dataclass(frozen=True, eq=False)
class Drawing:
    """Rows of panels. height: of a row in inches where the whole is `width` wide, for files."""

    rows: tuple[tuple[Panel, ...], ...]
    height: float = 3.4
    width: float = 9.0

    @property
    def panels(self) -> tuple[Panel, ...]:
        """All panels in order."""
        return tuple(panel for row in self.rows for panel in row)


def thinned(count: int, most: int = 6000) -> NDArray[np.intp]:
    """Choose at most so many of `count` rows, at random: figures stay small, and points no longer hide each other."""
    return np.sort(np.random.default_rng(0).permutation(count)[:most])


# --- What each figure of a profile, its samples and its errors shows -------------------------------------------------

ENDS = {"render": ("RAW after white balance", "JPEG"), "linearize": ("JPEG", "RAW after white balance")}
"""Per direction: what goes in, what comes out."""
LUMINANCE = SRGB_TO_XYZ[1]
"""Weights of linear sRGB's channels in Y."""


def chromaticity_outlines() -> tuple[Array, Array]:
    """The spectrum locus and sRGB's triangle in CIE 1931 xy, both closed, (m, 2)."""
    import colour  # imported here: it takes a second, and most commands never need it

    spectrum = colour.XYZ_to_xy(colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].values)
    primaries = colour.RGB_COLOURSPACES["sRGB"].primaries
    return np.vstack([spectrum, spectrum[:1]]), np.vstack([primaries, primaries[:1]])


def chromaticity_figure(encoded: Array) -> Drawing:
    """JPEG colours (n, 3) in the CIE 1931 xy diagram, each in its own colour, and L* over chroma beside it."""
    chosen = encoded[thinned(len(encoded))]
    spectrum, triangle = chromaticity_outlines()
    lab = srgb_to_lab(chosen)
    diagram = (
        Line(spectrum[:, 0], spectrum[:, 1], width=0.8, label="spectrum"),
        Line(triangle[:, 0], triangle[:, 1], colour="#000000", width=0.8, label="sRGB"),
        Dots(chromaticities(srgb_decode(chosen)), chosen, size=3),
    )
    chroma = np.column_stack([np.hypot(lab[:, 1], lab[:, 2]), lab[:, 0]])
    lightness = Panel("lightness and chroma", (Dots(chroma, chosen, size=3),), "C*", "L*", y_range=(0, 100))
    return Drawing(((Panel("chromaticity", diagram, "x", "y", equal=True), lightness),), 3.8)


def error_by_colour_figure(encoded: Array, error: Array) -> Drawing:
    """Held-out error (n,) of JPEG colours (n, 3) over a* b* and over lightness: which colours are predicted badly."""
    chosen = np.argsort(error)[thinned(len(error))]  # the largest on top
    lab, error, of = srgb_to_lab(encoded[chosen]), error[chosen], "RGB error, 1 = full scale"
    hues, scale = (Dots(lab[:, 1:], values=error, size=4),), (0.0, ERROR_SCALE)
    x, y = "a* (green – red)", "b* (blue – yellow)"
    by_hue = Panel("error over hue and chroma", hues, x, y, equal=True, scale=scale, scale_name=of)
    dots = Dots(np.column_stack([lab[:, 0], error]), encoded[chosen], size=4)
    return Drawing(((by_hue, Panel("error over lightness", (dots,), "L*", of)),), 3.8)


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
            marks.append(Line(even, function.of_all[:, channel], colour, "dashed", 0.8))
        panels.append(Panel(name, tuple(marks), "shorter exposure", "longer exposure", equal=True))
    return Drawing((tuple(panels),))


def response_figure(style: PictureStyle) -> Drawing:
    """f per channel over the linear value and over stops below saturation, with EMoR's mean and sRGB's curve."""
    linear = np.concatenate([np.linspace(0, 1, 513)[1:], 2.0 ** np.linspace(-8, 0, 257)])
    linear.sort()
    curves, mean = style.tones(linear), mean_response(linear)
    what = "The response f" if style.models else "The grey axis of the lattice"
    panels = []
    for x, label, reach in (
        (linear, "linear value, 1 = saturation", (0.0, 1.0)),
        (np.log2(linear), "stops below saturation", (-8.0, 0.0)),
    ):
        usual = Line(x, mean, GREY, "dotted", 1.0, "mean of 201 responses (EMoR)")
        marks = (usual, Line(x, srgb_encode(linear), label="sRGB", width=1.0), *_of_channels(x, curves))
        panels.append(Panel(what, marks, label, "JPEG value", reach, (0.0, 1.02)))
    return Drawing((tuple(panels),))


def bracket_figure(fit: BracketFit) -> Drawing:
    """The response of a bracket, per channel, over sRGB's own curve."""
    linear = np.linspace(0.0, 1.0, 257)
    values = fit.response.encode(np.repeat(linear[:, None], 3, axis=1))
    marks = (Line(linear, srgb_encode(linear), label="sRGB", width=1.0), *_of_channels(linear, values))
    labels = "linear value, 1 = saturation", "JPEG value"
    return Drawing(((Panel("The response f", marks, *labels, (0.0, 1.0), (0.0, 1.02)),),))


def _of_channels(x: Array, curves: Array, width: float = 2.0) -> list[Line]:
    return [Line(x, curves[:, c], colour, dash, width, name) for c, (name, colour, dash) in enumerate(CHANNELS)]


def cube_edges() -> Array:
    """The twelve edges of sRGB's cube by their linear ends, (12, 2, 3)."""
    corners = np.array([[r, g, b] for r in (0.0, 1.0) for g in (0.0, 1.0) for b in (0.0, 1.0)])
    pairs = [(i, j) for i in range(8) for j in range(i) if np.abs(corners[i] - corners[j]).sum() == 1]
    return np.asarray(corners[np.array(pairs)])


def slice_grid(luminance: float, rings: int = 17, points: int = 16) -> Array:
    """Cover the slice of the sRGB cube at a luminance 0 < Y < 1 with a grid (rings, n, 3) of linear colours.

    The first ring is the grey of this luminance, the last the slice's outline, closed, with `points` on each side.
    """
    first, second = cube_edges().transpose(1, 0, 2)
    low, high = first @ LUMINANCE - luminance, second @ LUMINANCE - luminance
    cut = (low < 0) != (high < 0)
    share = (low[cut] / (low[cut] - high[cut]))[:, None]
    corners = first[cut] + share * (second[cut] - first[cut])
    around = corners - luminance  # from the grey
    corners = corners[np.argsort(np.arctan2(around[:, 0] - around[:, 1], around[:, 2] - around[:, 1]))]
    along = np.arange(points)[:, None, None] / points
    sides = corners + along * (np.roll(corners, -1, axis=0) - corners)  # (points, corners, 3)
    outline = np.vstack([sides.transpose(1, 0, 2).reshape(-1, 3), corners[:1]])
    return luminance + np.linspace(0.0, 1.0, rings)[:, None, None] * (outline - luminance)


def centres_near(gamut_map: GamutMap | SolvedInverse, luminance: float) -> Array:
    """The control points (m, 3) of a gamut map that lie near this luminance; an inverse that is solved has none."""
    if isinstance(gamut_map, SolvedInverse):
        return np.zeros((0, 3))
    return np.asarray(gamut_map.centres[np.abs(gamut_map.centres @ LUMINANCE - luminance) < 0.04])


def gamut_figure(maps: Mapping[str, GamutMap | SolvedInverse], levels: Sequence[float] = (0.08, 0.25, 0.5)) -> Drawing:
    """h as slices of constant luminance: arrows from the colour before it to the one after (Fig. 4.4), a row a map.

    They are drawn over R − Y and B − Y in linear sRGB, coloured by how far h moves the colour.
    """
    axis = np.linspace(0.0, 1.0, 25)
    red, blue = (values.ravel() for values in np.meshgrid(axis, axis, indexing="ij"))
    rows, top = [], 0.02
    for name, gamut_map in maps.items():
        drawn = []
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
            drawn.append(Panel(f"{name}, Y = {level:.2f}", marks, "R − Y", "B − Y", equal=True))
        rows.append(drawn)
    name = "change, linear, 1 = full scale"
    return Drawing(tuple(tuple(replace(one, scale=(0.0, top), scale_name=name) for one in row) for row in rows), 3.1)


def _on_plane(colours: Array) -> Array:
    return np.asarray(colours[:, [0, 2]] - (colours @ LUMINANCE)[:, None])


def lattice_figure(style: PictureStyle, directions: Sequence[Direction]) -> Drawing:
    """Node levels, grey axis and coverage of a style's lattices, a row for each direction.

    Node levels are drawn against the cube coordinate: where the curve is flat, nodes are dense. Coverage is log10 of
    1 + the summed weight of the samples at the nodes, seen along the blue axis.
    """
    grey, rows = np.linspace(0, 1, 512), []
    for direction in directions:
        lattice, (source, target) = style.lattices[direction], ENDS[direction]
        curves = _of_channels(grey, lattice(np.repeat(grey[:, None], 3, axis=1)), 1.5)
        levels = [
            Line(np.linspace(0, 1, len(nodes)), nodes, colour, dash, label=name)
            for nodes, (name, colour, dash) in zip(lattice.levels, CHANNELS, strict=True)
        ]
        row = [Panel("node levels", tuple(levels), "cube coordinate", source)]
        row.append(Panel("grey axis", tuple(curves), source, target))
        covered = style.coverage.get(direction)
        if covered is not None:
            seen = np.log10(1 + covered.sum(axis=2)).T[::-1]
            title = f"nodes with samples, {float((covered > 0).mean()):.0%} of all"
            x, y = "red node, share", "green node, share"
            row.append(Panel(title, (Raster(seen, (1, 1)),), x, y, equal=True, scale=(0, max(seen.max(), 1e-6))))
        rows.append(tuple(row))
    return Drawing(tuple(rows), 3.0)


def levels_on_errors(lattice: Lattice, histograms: tuple[Array, Array, Array], source: str) -> Drawing:
    """Node levels over the histogram of the uniform lattice's squared errors, per axis (thesis, Fig. 5.4).

    histograms: per axis (bins,) over [0, 1], bins a multiple of 200.
    """
    edges, panels = np.linspace(0.0, 1.0, 201), []
    for levels, histogram, (name, colour, _) in zip(lattice.levels, histograms, CHANNELS, strict=True):
        density = histogram.reshape(200, -1).sum(axis=1)
        marks = (
            Bars(edges[:-1], edges[1:], np.zeros(200), density / max(float(density.max()), 1e-12), colour),
            Lines([np.array([[level, -0.14], [level, -0.02]]) for level in levels]),
        )
        panels.append(Panel(name, marks, source, "error of even nodes", y_range=(-0.2, 1.05)))
    return Drawing((tuple(panels),), 2.6)


def plane_figure(lattice: Lattice, target: str, levels: Mapping[int, float]) -> Drawing:
    """Draw the outputs of planes of nodes as nets in the other two channels (Fig. A.13). levels: by input channel."""
    panels = []
    for channel, level in levels.items():
        node = int(np.argmin(np.abs(lattice.levels[channel] - level)))
        first, second = (index for index in range(3) if index != channel)
        net = np.take(lattice.values, node, axis=channel)[..., [first, second]]
        marks = Lines(list(net), CHANNELS[second][1]), Lines(list(net.transpose(1, 0, 2)), CHANNELS[first][1])
        title = f"nodes at {CHANNELS[channel][0]} = {lattice.levels[channel][node]:.3f}"
        x, y = (f"{target}, {CHANNELS[along][0]}" for along in (first, second))
        panels.append(Panel(title, marks, x, y, equal=True))
    return Drawing((tuple(panels),), 3.2)
