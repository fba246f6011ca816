"""What each plot of the samples shows (thesis A.3): points, which samples they are, and the curve through them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import SRGB_TO_XYZ, chromaticities, srgb_decode
from lutforge.studio.bokeh_figure import hex_colours
from lutforge.studio.workspace import Workspace

Rows = NDArray[np.intp]

PLOTS = {
    "srgb_btf": "sRGB BTF",
    "raw_btf": "RAW BTF",
    "srgb_raw": "sRGB against RAW",
    "saturation": "Saturation against brightness",
    "transformed": "Transformed RAW against sRGB",
    "rendering": "RAW → sRGB: transformed RAW against linearized sRGB",
    "linearizing": "sRGB → RAW: transformed RAW against linearized sRGB",
    "linearization": "Linearization",
}
OF_PAIRS = ("srgb_btf", "raw_btf", "linearization")
COLOURS = ("exposure pair", "own colour", "shot", "residual")
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#5b5b5b", "#8c6d31")
"""Okabe and Ito's colours, told apart by colour-blind eyes, and three more."""
DIAGONAL = (np.array([[0.0, 1.0], [0.0, 1.0]]),)


@dataclass(frozen=True, eq=False)
class Points:
    """The points of a plot.

    x, y: (n,); row, partner: (n,) the samples that a point stands for, equal where it is one; pair: (n,) the number of
    the exposure pair, −1 for none; curves: (2, m) each; missing: why there are no points.
    """

    x: Array
    y: Array
    row: Rows
    partner: Rows
    pair: Rows
    x_label: str = ""
    y_label: str = ""
    curves: tuple[Array, ...] = ()
    missing: str = ""

    def __len__(self) -> int:
        return len(self.x)

    def select(self, keep: Mask) -> "Points":
        """The points of a mask (n,)."""
        parts = {name: getattr(self, name)[keep] for name in ("x", "y", "row", "partner", "pair")}
        return self if keep.all() else replace(self, **parts)


def points(workspace: Workspace, plot: str, channel: int) -> Points:
    """All points of one plot and channel that are known."""
    samples, pairs = workspace.samples, workspace.pairs
    predicted = None if workspace.fitted is None else workspace.fitted.predicted
    if predicted is None and plot in ("transformed", "rendering", "linearizing", "linearization"):
        return _nothing("fit a model first: this plot shows what it makes of the values")
    if plot in OF_PAIRS:
        if pairs is None:
            return _nothing("no two shots show the same patches at different exposures")
        pairs = pairs.without(workspace.unticked)
        rows, number = (pairs.first_row, pairs.second_row), pairs.of_shots
    else:
        rows, number = (np.arange(len(samples)),) * 2, pair_of_rows(workspace)
    curves: tuple[Array, ...] = DIAGONAL if plot in ("rendering", "linearizing", "linearization") else ()
    match plot:
        case "srgb_btf":
            assert pairs is not None
            curves = _brightness_transfers(workspace, pairs.log_ratio, channel)
            at, labels = (pairs.first, pairs.second), ("sRGB, shorter exposure", "sRGB, longer exposure")
        case "raw_btf":
            assert pairs is not None
            at, labels = (pairs.raw_first, pairs.raw_second), ("RAW, shorter exposure", "RAW, longer exposure")
        case "linearization":
            assert pairs is not None and predicted is not None
            ratio = np.exp(pairs.log_ratio)[:, None]
            at = ratio * predicted.linearized[rows[0]], predicted.linearized[rows[1]]
            labels = ("k · linearized, shorter exposure", "linearized, longer exposure")
        case "srgb_raw":
            at, labels = (samples.raw, samples.srgb), ("RAW, before white balance", "sRGB")
        case "saturation":
            largest = samples.srgb.max(axis=1, keepdims=True).repeat(3, axis=1)
            at = largest, workspace.columns["saturation"][:, None].repeat(3, axis=1)
            labels = ("largest channel, sRGB", "saturation")
        case "transformed":
            assert predicted is not None and workspace.fitted is not None
            at, labels = (predicted.transformed, samples.srgb), ("transformed RAW, before the response", "sRGB")
            even = np.linspace(0.0, 1.0, 257)
            style = next(iter(workspace.fitted.profile.styles.values()))
            curves = (np.stack([even, style.tones(even)[:, channel]]),)
        case _:
            assert predicted is not None
            both = (predicted.transformed, predicted.decoded), (predicted.scene, predicted.linearized)
            at, labels = both[plot == "linearizing"], ("transformed RAW", "linearized sRGB")
    x, y = at[0][:, channel], at[1][:, channel]
    shown = Points(x, y, *rows, number, *labels, curves)
    known = np.isfinite(x) & np.isfinite(y)
    missing = "" if known.any() else "no sample has these values"
    return replace(shown.select(known), missing=missing)


def _nothing(missing: str) -> Points:
    none, rows = np.zeros(0), np.zeros(0, dtype=np.intp)
    return Points(none, none, rows, rows, rows, missing=missing)


def _brightness_transfers(workspace: Workspace, log_ratio: Array, channel: int) -> tuple[Array, ...]:
    """(2, 256) each: f(k f⁻¹(I)) over I, the brightness transfer functions of the ratios k of exposure pairs."""
    response = workspace.response
    if response is None:
        return ()
    encoded = np.linspace(0.0, 1.0, 256)
    linear = response.linearize(np.repeat(encoded[:, None], 3, axis=1))
    # Times are read off to a hundredth of a stop: what differs by less is one ratio.
    ratios = np.unique(np.rint(100 * log_ratio / np.log(2))).tolist()
    return tuple(np.stack([encoded, response.encode(2.0 ** (ratio / 100) * linear)[:, channel]]) for ratio in ratios)


def pair_of_rows(workspace: Workspace) -> Rows:
    """(n,) the number of a pair that each sample takes part in, −1 where none."""
    number = np.full(len(workspace.samples), -1, dtype=np.intp)
    pairs = workspace.pairs
    if pairs is not None:
        number[pairs.second_row] = number[pairs.first_row] = pairs.of_shots
    return number


def colours_in_space(workspace: Workspace, shown: str) -> tuple[Array, Rows]:
    """Linear sRGB (n, 3) of the JPEG, of the transformed RAW, or of both, and the samples that they are of.

    shown: "JPEG colours", "transformed RAW" or "both".
    """
    parts = [] if shown == "transformed RAW" else [srgb_decode(np.clip(workspace.samples.srgb, 0.0, 1.0))]
    if shown != "JPEG colours" and workspace.fitted is not None:
        parts.append(workspace.fitted.predicted.scene)
    linear = np.concatenate([*parts, np.zeros((0, 3))])
    known = np.isfinite(linear).all(axis=1)
    return linear[known], np.tile(np.arange(len(workspace.samples)), len(parts))[known]


def in_chromaticity_diagram(workspace: Workspace, shown: str) -> Points:
    """The points of `colours_in_space` in CIE 1931 xy."""
    linear, row = colours_in_space(workspace, shown)
    x, y = chromaticities(linear).T
    return Points(x, y, row, row, np.full(len(row), -1, dtype=np.intp), "x", "y")


def tristimulus(linear: Array) -> Array:
    """CIE X, Z, Y (…, 3) of linear sRGB, Y of white 1, in the order of axes of which the last is up."""
    return np.asarray((linear @ SRGB_TO_XYZ.T)[..., [0, 2, 1]])


def drawn(count: int, always: Rows | None = None, most: int = 4000) -> Rows:
    """Which of `count` points are drawn: at most `most`, the same ones each time, and up to as many that must be."""
    if count <= most:
        return np.arange(count)
    chosen = np.random.default_rng(0).permutation(count)[:most]
    if always is not None and len(always):
        chosen = np.concatenate([chosen, always[np.random.default_rng(1).permutation(len(always))[:most]]])
    return np.unique(chosen)


def colours(workspace: Workspace, all_points: Points, chosen: Rows, by: str) -> list[str]:
    """A colour "#rrggbb" of each chosen point. by: one of COLOURS."""
    row = all_points.row[chosen]
    if by == "own colour":
        return hex_colours(workspace.samples.srgb[row])
    if by == "residual":
        import matplotlib as mpl

        scale = np.clip(workspace.residual[row] / 0.1, 0.0, 1.0)  # what is further off is of one colour
        return hex_colours(np.asarray(mpl.colormaps["cividis"](np.nan_to_num(scale)))[..., :3])
    if by == "shot":
        _, number = np.unique(workspace.samples.shot, return_inverse=True)
        return [PALETTE[index % len(PALETTE)] for index in number[row]]
    present = np.unique(all_points.pair)
    place = np.searchsorted(present[present >= 0], all_points.pair[chosen])
    paired = all_points.pair[chosen] >= 0
    return [PALETTE[at % len(PALETTE)] if known else "#9a9a9a" for at, known in zip(place, paired, strict=True)]


def inside_polygon(x: Array, y: Array, corners_x: Sequence[float], corners_y: Sequence[float]) -> Mask:
    """(n,) of points (n,): inside a polygon, even-odd rule."""
    from matplotlib.path import Path

    corners = np.column_stack([corners_x, corners_y])
    if len(corners) < 3:
        return np.zeros(len(x), dtype=np.bool_)
    return np.asarray(Path(corners).contains_points(np.column_stack([x, y])), dtype=np.bool_)


def rows_at(all_points: Points, where: Mask, count: int) -> Mask:
    """(count,) the samples that the points of a mask stand for."""
    rows = np.zeros(count, dtype=np.bool_)
    rows[all_points.row[where]] = rows[all_points.partner[where]] = True
    return rows


def nearest(all_points: Points, x: float, y: float, reach: float) -> Mask:
    """(n,) the one point nearest to (x, y), where it is within reach."""
    where = np.zeros(len(all_points), dtype=np.bool_)
    if len(where):
        distance = np.hypot(all_points.x - x, all_points.y - y)
        closest = int(np.argmin(distance))
        where[closest] = distance[closest] <= reach
    return where
