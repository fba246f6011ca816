"""What each plot of the samples shows (thesis A.3): points, which samples they are, and the curve through them."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.model.response import Response
from lutforge.studio.workspace import Workspace

Rows = NDArray[np.intp]

PLOTS = {
    "srgb_btf": "sRGB BTF",
    "raw_btf": "RAW BTF",
    "srgb_raw": "sRGB against RAW",
    "saturation": "Saturation against brightness",
    "transformed": "Transformed RAW against sRGB",
    "both_linear": "Transformed RAW against linearized sRGB",
    "linearization": "Linearization",
}
COLOURS = ("exposure pair", "own colour", "shot", "residual")
_NONE: tuple[Array, ...] = ()
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#5b5b5b", "#8c6d31")
"""Okabe and Ito's colours, told apart by colour-blind eyes, and three more."""


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
        if keep.all():
            return self
        parts = {name: getattr(self, name)[keep] for name in ("x", "y", "row", "partner", "pair")}
        return replace(self, **parts)


def points(workspace: Workspace, plot: str, channel: int) -> Points:
    """The points of one plot and channel, all of them."""
    if plot in ("srgb_btf", "raw_btf", "linearization"):
        return _of_pairs(workspace, plot, channel)
    return _of_samples(workspace, plot, channel)


def _of_samples(workspace: Workspace, plot: str, channel: int) -> Points:
    samples, fitted, response = workspace.samples, workspace.fitted, workspace.response
    row = np.arange(len(samples))
    pair = pair_of_rows(workspace)
    if plot == "srgb_raw":
        return Points(
            samples.raw[:, channel], samples.srgb[:, channel], row, row, pair, "RAW, before white balance", "sRGB"
        )
    if plot == "saturation":
        return Points(samples.srgb.max(axis=1), workspace.chroma, row, row, pair, "largest channel, sRGB", "saturation")
    if fitted is None:
        return _nothing("fit a model first: this plot shows what it makes of the RAW values")
    if plot == "transformed":
        curve, label = _NONE, "RAW as the lattice renders it"
        if response is not None:
            inverse = response.inverse[:, channel]
            curve = (np.stack([inverse, np.linspace(0.0, 1.0, len(inverse))]),)
            label = "transformed RAW, before the response"
        return _finite(
            Points(fitted.transformed[:, channel], samples.srgb[:, channel], row, row, pair, label, "sRGB", curve)
        )
    line = (np.array([[0.0, 1.0], [0.0, 1.0]]),)
    x, y = fitted.scene[:, channel], fitted.linearized[:, channel]
    return _finite(Points(x, y, row, row, pair, "transformed RAW", "linearized sRGB", line))


def _of_pairs(workspace: Workspace, plot: str, channel: int) -> Points:
    pairs, fitted, response = workspace.pairs, workspace.fitted, workspace.response
    if pairs is None:
        return _nothing("no two shots show the same patches at different exposures")
    pairs = pairs.without(workspace.unticked)
    first, second = pairs.first_row, pairs.second_row
    number = pairs.of_shots
    if plot == "srgb_btf":
        curve = _NONE
        if response is not None:
            # Times are read off to a hundredth of a stop: what differs by less is one ratio.
            ratios = np.unique(np.rint(100 * pairs.log_ratio / np.log(2)))
            curve = tuple(_brightness_transfer(response, channel, 2.0 ** (stops / 100)) for stops in ratios.tolist())
        x, y = pairs.first[:, channel], pairs.second[:, channel]
        return Points(x, y, first, second, number, "sRGB, shorter exposure", "sRGB, longer exposure", curve)
    if plot == "raw_btf":
        x, y = pairs.raw_first[:, channel], pairs.raw_second[:, channel]
        return _finite(Points(x, y, first, second, number, "RAW, shorter exposure", "RAW, longer exposure"))
    if fitted is None:
        return _nothing("fit a model first: this plot shows what it linearizes")
    ratio = np.exp(pairs.log_ratio)
    x, y = ratio * fitted.linearized[first, channel], fitted.linearized[second, channel]
    line = (np.array([[0.0, 1.0], [0.0, 1.0]]),)
    labels = ("k · linearized, shorter exposure", "linearized, longer exposure")
    return _finite(Points(x, y, first, second, number, *labels, line))


def _nothing(missing: str) -> Points:
    none, rows = np.zeros(0), np.zeros(0, dtype=np.intp)
    return Points(none, none, rows, rows, rows, missing=missing)


def _finite(all_points: Points) -> Points:
    return all_points.select(np.isfinite(all_points.x) & np.isfinite(all_points.y))


def _brightness_transfer(response: Response, channel: int, ratio: float) -> Array:
    """(2, 256): f(k f⁻¹(I)) over I, the brightness transfer function of pairs of one exposure ratio k."""
    encoded = np.linspace(0.0, 1.0, 256)
    grey = np.repeat(encoded[:, None], 3, axis=1)
    return np.stack([encoded, response.encode(ratio * response.linearize(grey))[:, channel]])


def pair_of_rows(workspace: Workspace) -> Rows:
    """(n,) the number of a pair that each sample takes part in, −1 where none."""
    number = np.full(len(workspace.samples), -1, dtype=np.intp)
    pairs = workspace.pairs
    if pairs is not None:
        number[pairs.second_row] = number[pairs.first_row] = pairs.of_shots
    return number


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
        scale = np.clip(workspace.residual[row] / 0.1, 0.0, 1.0)  # what is further off is of one colour
        return hex_colours(_cividis(np.nan_to_num(scale)))
    if by == "shot":
        _, number = np.unique(workspace.samples.shot, return_inverse=True)
        return [PALETTE[index % len(PALETTE)] for index in number[row]]
    present = np.unique(all_points.pair)
    place = np.searchsorted(present[present >= 0], all_points.pair[chosen])
    paired = all_points.pair[chosen] >= 0
    return [PALETTE[at % len(PALETTE)] if known else "#9a9a9a" for at, known in zip(place, paired, strict=True)]


def _cividis(share: Array) -> Array:
    import matplotlib as mpl

    return np.asarray(mpl.colormaps["cividis"](share))[..., :3]


def hex_colours(rgb: Array) -> list[str]:
    """Encoded colours (n, 3) in [0, 1] as "#rrggbb"."""
    codes = np.rint(np.clip(rgb, 0.0, 1.0) * 255).astype(np.int64)
    return [f"#{value:06x}" for value in (codes[:, 0] << 16) | (codes[:, 1] << 8) | codes[:, 2]]


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
    rows[all_points.row[where]] = True
    rows[all_points.partner[where]] = True
    return rows


def nearest(all_points: Points, x: float, y: float, reach: float) -> Mask:
    """(n,) the one point nearest to (x, y), where it is within reach."""
    where = np.zeros(len(all_points), dtype=np.bool_)
    if len(where):
        distance = np.hypot(all_points.x - x, all_points.y - y)
        closest = int(np.argmin(distance))
        where[closest] = distance[closest] <= reach
    return where
