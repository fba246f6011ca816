"""Samples: linked plots, filters, marks by hand, named groups of outliers (thesis A.3, A.3.1)."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.events import SelectionGeometry, Tap
from bokeh.models import ColumnDataSource, LassoSelectTool, Range1d
from matplotlib.path import Path
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.colour.srgb import SRGB_TO_XYZ, chromaticities, srgb_decode
from lutforge.reports.drawing import GREY, Dots, Drawing, Panel, Raster, thinned
from lutforge.reports.figures import chromaticity_outlines, cube_edges
from lutforge.samples.sample_set import SampleSet
from lutforge.studio import ui
from lutforge.studio.session import Session
from lutforge.studio.workspace import COLUMNS, Workspace, WorkspaceError

Rows = NDArray[np.intp]

SELECT = "lasso_select,box_select,pan,wheel_zoom,reset,save"

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
BRACKET_FIT = (
    "Limits and groups choose what is drawn of a bracket: its response is fitted to all colours of the pictures that "
    "are ticked under Shots."
)
MOST_DRAWN = 4000
COLOURS = ("exposure pair", "own colour")
PALETTE = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#7a5195", "#5b5b5b", "#8c6d31")
"""Okabe and Ito's colours, told apart by colour-blind eyes, and three more."""


class SamplesPage:
    """The page of the second step: plots of samples, filters, marks and groups of outliers."""

    def __init__(self, session: Session) -> None:
        self.session = session
        session.page.on_select = self.mark
        self._seen: SampleSet | None = None
        plots = {title: key for key, title in PLOTS.items()}
        self.first = ui.select("Left plot", plots, value="srgb_btf")
        self.second = ui.select("Right plot", plots, value="srgb_raw")
        self.channel = ui.select("Channel", {"Red": 0, "Green": 1, "Blue": 2}, value=1)
        self.by = ui.select("Colour by", list(COLOURS))
        self.inliers = ui.checkbox("Inliers only")
        self.space_of = ui.select("In xy and XYZ", ["JPEG colours", "transformed RAW", "both"])
        self.picture_of = ui.select("Picture of the shot", ui.NOTHING)
        views = (self.first, self.second, self.channel, self.by, self.space_of, self.picture_of, self.inliers)
        session.page.watch(self.refresh, *views)
        self.counts = ui.text()
        self.words = ui.entry("Select row, shot or patch")
        session.page.watch(
            lambda: session.select(find_rows(session.require_workspace().samples, self.words.value)), self.words
        )
        self.group = ui.entry("Outlier group", placeholder="name")
        self.remembered = (*views, self.words, self.group)
        self.groups = pmui.CheckBoxGroup(label="Groups in effect", options=[], **ui.FULL_WIDTH)
        self.bound = [session.bind(self.groups, lambda now: now.active_groups, Workspace.with_active_groups)]
        limits = []
        for name, column in COLUMNS.items():
            reach = {"start": column.reach[0], "end": column.reach[1], "step": column.step}
            limits.append(
                pmui.RangeSlider(label=column.title, value=column.reach, **reach, size="small", **ui.FULL_WIDTH)
            )
            read = partial(Workspace.limits_of, name=name)
            put = partial(Workspace.with_limits, name=name)
            self.bound.append(session.bind(limits[-1], read, put))
        small: dict[str, Any] = {"sizing_mode": "stretch_width", "margin": 2}
        actions: tuple[dict[str, Callable[[], None]], ...] = (
            {"Outliers": lambda: self._mark(1), "Keep": lambda: self._mark(-1), "Unmark": lambda: self._mark(0)},
            {"Save group": self._save_group, "Delete group": partial(self._save_group, delete=True)},
        )
        rows = [
            pn.Row(*(session.page.button(label, action, **small) for label, action in row.items()), **ui.FULL_WIDTH)
            for row in actions
        ]
        self.channel.param.update(sizing_mode="fixed", width=105)
        coloured = pn.Row(self.channel, self.by, sizing_mode="stretch_width")
        self.controls = [
            pn.Column(self.first, self.second, coloured, *views[4:], **ui.TOGETHER),
            pn.Column(self.words, rows[0], **ui.TOGETHER),
            pn.Column(*limits, self.counts, **ui.TOGETHER),
            pn.Column(self.group, rows[1], self.groups, **ui.TOGETHER),
        ]
        self.left, self.right = BrushedPlot(session), BrushedPlot(session)
        ranges = {"x_range": Range1d(-0.08, 0.92), "y_range": Range1d(-0.03, 0.87)}
        self.chromaticity = BrushedPlot(session, "CIE xy: inliers ●, outliers ×", **ranges)
        for outline in chromaticity_outlines():
            self.chromaticity.figure.line(*outline.T, color=GREY, width=1.0)
        self.space = ui.Space()
        self.picture = ui.Figures()
        self.selection = ui.text(styles={"overflow": "auto"}, height=110)
        chosen = pn.Column(self.picture.layout, self.selection, **ui.FILL)
        self.main = pn.Column(
            pn.Row(self.left.figure, self.right.figure, **ui.FILL),
            pn.Row(self.chromaticity.figure, self.space.layout, chosen, **ui.FILL), **ui.FILL,
        )  # fmt: skip

    def refresh(self) -> None:
        """Draw the session's workspace."""
        workspace = self.session.workspace
        if workspace is None:
            return
        if self._seen is not workspace.samples:
            self._seen = workspace.samples
            if self.first.value in (OF_PAIRS[0], "saturation"):  # without pairs, what the filters cut
                paired = workspace.pairs is not None
                self.first.value, self.by.value = (OF_PAIRS[0], COLOURS[0]) if paired else ("saturation", COLOURS[1])
            if not workspace.has_raw:
                self.second.value = "saturation"
        accounts = self.session.opened.accounts
        ui.offer(self.picture_of, [account.shot for account in accounts if account.cells is not None])
        self.groups.options = list(workspace.groups)
        self.groups.visible = bool(workspace.groups)
        for show in self.bound:
            show(workspace)
        outside = "; ".join(f"{COLUMNS[name].title}: {out.sum():,}" for name, out in workspace.filtered.items())
        self.counts.object = ui.paragraphs(
            f"{int((~workspace.outliers).sum()):,} of {len(workspace.samples):,} samples are inliers. Left out by each "
            f"limit: {outside}. By hand, by groups and with shots: {int(workspace.excluded.sum()):,}.",
            *([] if workspace.has_raw else [BRACKET_FIT]),
        )
        for plot, choice in ((self.left, self.first.value), (self.right, self.second.value)):
            shown = points(workspace, choice, self.channel.value)
            plot.figure.title.text = shown.missing or PLOTS[choice]
            plot.show(workspace, shown, self.by.value, self.inliers.value)
            plot.frame((choice, self.channel.value, workspace.samples))
        linear, row = colours_in_space(workspace, self.space_of.value)
        x, y = chromaticities(linear).T
        shown = Points(x, y, row, row, np.full(len(row), -1, dtype=np.intp), "x", "y")
        self.chromaticity.show(workspace, shown, COLOURS[1], self.inliers.value, 4.0)

        # In CIE XYZ, within the cube of sRGB
        chosen = thinned(len(row), MOST_DRAWN)
        xyz = tristimulus(linear[chosen])
        row = row[chosen]
        out = workspace.outliers[row]
        inside = ui.dots_in_space(xyz[~out], ui.hex_colours(workspace.samples.srgb[row[~out]]))
        traces = [ui.lines_in_space(tristimulus(cube_edges())), inside]
        traces += [] if self.inliers.value else [ui.dots_in_space(xyz[out], "#e0503c", symbol="x")]
        self.space.show("CIE XYZ: outliers red", traces, ("X", "Z", "Y"))
        self.mark()

    def mark(self) -> None:
        """The selection, in all plots, in the picture of its shot, and in words."""
        for drawing in (self.left, self.right, self.chromaticity):
            drawing.mark()
        workspace = self.session.workspace
        selected = self.session.selected
        chosen = self.picture_of.value
        if workspace is None:
            return
        self.selection.object = describe(workspace, np.flatnonzero(selected))
        # The shot of the first selected sample, or the chosen one, with frames round its samples
        shot = workspace.samples.shot
        if selected.any() and not (selected & (shot == chosen)).any():
            chosen = str(shot[np.flatnonzero(selected)[0]])
            if chosen in self.picture_of.options:
                with self.session.page.setting():
                    self.picture_of.value = chosen
        account = {account.shot: account for account in self.session.opened.accounts}.get(chosen)
        rows = shot == chosen
        out = workspace.outliers
        if account is None or account.cells is None or len(account.places) != rows.sum():
            self.picture.show(None, "Open the folder of the shots to see where samples are.")
            return
        picture = account.cells.picture / 255
        places = (account.places * [1, -1] + [0, 1]) * picture.shape[1::-1]
        kinds = ((~out & ~selected, "#ffffff", 5.0), (out, "#ff8c00", 7.0), (selected, "#00e5ff", 11.0))
        frames = [Dots(places[which[rows]], colour, marker="square", size=size) for which, colour, size in kinds]
        self.picture.show(Drawing(((Panel(chosen, (Raster(picture), *frames), bare=True, equal=True),),)))

    def _mark(self, mark: int) -> None:
        workspace = self.session.require_workspace()
        rows = self.session.selected
        if not workspace.has_raw:
            raise WorkspaceError("the colours of a bracket are not chosen by hand: leave pictures out under Shots")
        if not rows.any():
            raise WorkspaceError("no samples selected: draw a lasso in a plot, or name rows")
        done = {1: "marked as outliers", -1: "kept by hand", 0: "no longer marked"}[mark]
        self.session.change_workspace(workspace.mark(rows, mark), f"{int(rows.sum()):,} samples {done}")

    def _save_group(self, delete: bool = False) -> None:
        """Save the selected samples, or else all outliers, as the named group; or delete that group."""
        workspace = self.session.require_workspace()
        name = ui.written(self.group)
        if delete:
            self.session.change_workspace(workspace.without_group(name), f"outlier group {name} deleted")
            return
        rows = self.session.selected if self.session.selected.any() else workspace.outliers
        news = f"outlier group {name}: {int(rows.sum()):,} samples, in effect"
        self.session.change_workspace(workspace.with_group(name, rows), news)


def describe(workspace: Workspace, rows: Rows) -> ui.Html:
    """Selected samples in words."""
    samples = workspace.samples
    if len(rows) == 0:
        return ui.paragraphs(
            "No sample selected: draw a lasso or a box in a plot, click a point, or name a row. In the picture "
            "outliers have orange frames, selected samples blue ones."
        )
    out = int(workspace.outliers[rows].sum())
    lines = [ui.html("<h2>{} selected, {} of them outliers</h2>", f"{len(rows):,}", f"{out:,}")]
    for row in rows[:8]:
        codes = ", ".join(f"{255 * value:.0f}" for value in samples.srgb[row])
        raw = "" if not workspace.has_raw else "; RAW " + ", ".join(f"{value:.3f}" for value in samples.raw[row])
        where = f"row {row}, shot {samples.shot[row]}, patch {samples.patch[row]}"
        setting = f"{samples.style[row]}/{samples.white_balance[row]}: JPEG {codes}{raw}"
        (colour,) = ui.hex_colours(samples.srgb[row : row + 1])
        lines.append(ui.html("<p><i class=colour style='background:{}'></i>{}<br>{}</p>", colour, where, setting))
    lines += [ui.html("<p>and {} more</p>", f"{len(rows) - 8:,}")] if len(rows) > 8 else []
    return ui.Html("".join(lines))


def find_rows(samples: SampleSet, words: str) -> Mask:
    """(n,) rows by number ("12, 40-60"), else by the name of their shot or patch. Raises WorkspaceError: none of these.

    Without words there is nothing to find, and no row is selected.
    """
    words = words.strip()
    count = len(samples)
    rows = np.zeros(count, dtype=np.bool_)
    if re.fullmatch(r"[\d\s,-]{1,2000}", words):
        for first, last in re.findall(r"(\d{1,12})(?:\s*-\s*(\d{1,12}))?", words):
            rows[int(first) : int(last or first) + 1] = True
    else:
        rows = (samples.shot == words) | (samples.patch == words)
    if words and not rows.any():
        raise WorkspaceError(f"{words[:60]}: no such row, shot or patch; rows count from 0 to {count - 1}")
    return rows


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
    curves: Sequence[Array] = ()
    missing: str = ""

    def __len__(self) -> int:
        return len(self.x)

    def select(self, keep: Mask) -> "Points":
        """The points of a mask (n,)."""
        return replace(self, **{name: getattr(self, name)[keep] for name in ("x", "y", "row", "partner", "pair")})


def points(workspace: Workspace, plot: str, channel: int) -> Points:
    """The points of one plot and channel, as far as they are known."""
    samples = workspace.samples
    pairs = workspace.pairs
    fitted = workspace.fitted
    largest = samples.srgb.max(axis=1, keepdims=True).repeat(3, axis=1)
    saturation = workspace.columns["saturation"][:, None].repeat(3, axis=1)
    shown = {
        "srgb_raw": (samples.raw, samples.srgb, "RAW, before white balance", "sRGB"),
        "saturation": (largest, saturation, "largest channel, sRGB", "saturation"),
    }
    row = partner = np.arange(len(samples))
    number = np.full(len(samples), -1, dtype=np.intp)
    curves = list[Array]()
    if pairs is not None:
        number[pairs.second_row] = number[pairs.first_row] = pairs.shot_pair
        pairs = pairs.without(workspace.unticked_pairs)
        shown["srgb_btf"] = pairs.first, pairs.second, "sRGB, shorter exposure", "sRGB, longer exposure"
        shown["raw_btf"] = pairs.raw_first, pairs.raw_second, "RAW, shorter exposure", "RAW, longer exposure"
        if plot in OF_PAIRS:
            row = pairs.first_row
            partner = pairs.second_row
            number = pairs.shot_pair
        if plot == "srgb_btf":
            curves = brightness_transfers(workspace, pairs.log_ratio, channel)
    if fitted is not None:
        made = fitted.predicted
        shown["transformed"] = made.transformed, samples.srgb, "transformed RAW, before the response", "sRGB"
        shown["rendering"] = made.transformed, made.decoded, "transformed RAW", "linearized sRGB"
        shown["linearizing"] = made.scene, made.linearized, "transformed RAW", "linearized sRGB"
        if pairs is not None and plot == "linearization":
            first = np.exp(pairs.log_ratio)[:, None] * made.linearized[row]
            labels = "k · linearized, shorter exposure", "linearized, longer exposure"
            shown[plot] = first, made.linearized[partner], *labels
        if plot == "transformed":
            even = np.linspace(0.0, 1.0, 257)
            curves = [np.stack([even, next(iter(fitted.profile.styles.values())).tones(even)[:, channel]])]
        elif plot in ("rendering", "linearizing", "linearization"):
            curves = [np.array([[0.0, 1.0], [0.0, 1.0]])]
    if plot not in shown:
        unfitted = fitted is None and plot not in ("srgb_btf", "raw_btf")
        missing = (
            "fit a model first: this plot shows what it makes of the values" if unfitted
            else "no two shots show the same patches at different exposures"
        )  # fmt: skip
        none = np.zeros(0, dtype=np.intp)
        return Points(np.zeros(0), np.zeros(0), none, none, none, missing=missing)
    x, y, x_label, y_label = shown[plot]
    all_points = Points(x[:, channel], y[:, channel], row, partner, number, x_label, y_label, curves)
    known = np.isfinite(all_points.x) & np.isfinite(all_points.y)
    return replace(all_points.select(known), missing="" if known.any() else "no sample has these values")


def brightness_transfers(workspace: Workspace, log_ratio: Array, channel: int) -> list[Array]:
    """(2, 256) each: f(k f⁻¹(I)) over I, the brightness transfer functions of the ratios k of exposure pairs."""
    response = workspace.response
    if response is None:
        return []
    encoded = np.linspace(0.0, 1.0, 256)
    linear = response.linearize(np.repeat(encoded[:, None], 3, axis=1))
    # Times are read off to a hundredth of a stop: what differs by less is one ratio.
    ratios = np.unique(np.rint(100 * log_ratio / np.log(2))).tolist()
    return [np.stack([encoded, response.encode(2.0 ** (ratio / 100) * linear)[:, channel]]) for ratio in ratios]


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


def tristimulus(linear: Array) -> Array:
    """CIE X, Z, Y (…, 3) of linear sRGB, Y of white 1, in the order of axes of which the last is up."""
    return np.asarray((linear @ SRGB_TO_XYZ.T)[..., [0, 2, 1]])


def colours(workspace: Workspace, all_points: Points, chosen: Rows, by: str) -> list[str]:
    """A colour "#rrggbb" of each chosen point. by: one of COLOURS."""
    row = all_points.row[chosen]
    pair = all_points.pair
    if by == "own colour":
        return ui.hex_colours(workspace.samples.srgb[row])
    number = np.where(pair < 0, -1, np.searchsorted(np.unique(pair[pair >= 0]), pair))[chosen]
    return [PALETTE[index % len(PALETTE)] if index >= 0 else GREY for index in number.tolist()]


class BrushedPlot:
    """A scatter plot of samples whose points can be selected; the session hears of it, and tells all others."""

    def __init__(self, session: Session, title: str = "", **options: Any) -> None:
        self.session = session
        self.points: Points | None = None
        self.framed: object = None
        self.chosen = np.zeros(0, dtype=np.intp)
        self.source = ColumnDataSource({name: [] for name in ("x", "y", "colour", "marker", "size")})
        self.lines = ColumnDataSource({"xs": [], "ys": []})
        # Ranges are set as points are shown: an empty plot has none of its own.
        self.figure = ui.plot(title, SELECT, **{"x_range": Range1d(0, 1), "y_range": Range1d(0, 1), **options})
        self.figure.multi_line("xs", "ys", source=self.lines, color=GREY, width=1.6)
        marks = self.figure.scatter(
            "x", "y", source=self.source, marker="marker", size="size", color="colour", line_width=0.8, fill_alpha=0.7
        )
        marks.selection_glyph = marks.glyph.clone(line_color=GREY, line_width=1.6, fill_alpha=1.0, size=8)
        marks.nonselection_glyph = marks.glyph.clone(fill_alpha=0.18, line_alpha=0.25)
        self.figure.toolbar.active_drag = self.figure.select_one(LassoSelectTool)
        for event in (SelectionGeometry, Tap):
            self.figure.on_event(event, session.page.guarded(self._select))

    def show(self, workspace: Workspace, shown: Points, by: str, inliers: bool, size: float = 5.0) -> None:
        """Show other points, those of inliers alone where that is asked for: at most 4000, and what is selected."""
        out = workspace.outliers[shown.row] | workspace.outliers[shown.partner]
        if inliers:
            shown = shown.select(~out)
            out = out[~out]
        self.points = shown
        self.chosen = thinned(len(shown), MOST_DRAWN)
        if len(shown) > MOST_DRAWN:
            selected = np.flatnonzero(self.session.selected[shown.row])
            self.chosen = np.union1d(self.chosen, selected[thinned(len(selected), MOST_DRAWN)])
        self.source.selected.indices = []
        self.source.data = {
            "x": shown.x[self.chosen],
            "y": shown.y[self.chosen],
            "colour": colours(workspace, shown, self.chosen, by),
            "marker": np.where(out[self.chosen], "x", "circle").tolist(),
            "size": np.full(len(self.chosen), size),
        }
        self.lines.data = {"xs": [x for x, _ in shown.curves], "ys": [y for _, y in shown.curves]}
        self.figure.xaxis.axis_label = shown.x_label
        self.figure.yaxis.axis_label = shown.y_label

    def frame(self, key: object) -> None:
        """Let the ranges follow the points. key: what is drawn; as long as it is the same, the ranges stay."""
        if self.points is None or key == self.framed:
            return
        self.framed = key
        for axis, values in ((self.figure.x_range, self.points.x), (self.figure.y_range, self.points.y)):
            low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
            low, high = low - 0.04 * max(high - low, 1e-3), high + 0.04 * max(high - low, 1e-3)
            axis.update(start=low, end=high, reset_start=low, reset_end=high)

    def mark(self) -> None:
        """Show the session's selection in this plot."""
        if self.points is not None:
            selected = self.session.selected[self.points.row] | self.session.selected[self.points.partner]
            self.source.selected.indices = np.flatnonzero(selected[self.chosen]).tolist()

    def _select(self, event: SelectionGeometry | Tap) -> None:
        """Select what a lasso or a box holds, by the even-odd rule, or the point nearest to a click, within reach."""
        shown = self.points
        if shown is None or len(shown) == 0:
            return
        where = np.zeros(len(shown), dtype=np.bool_)
        if isinstance(event, Tap):
            distance = np.hypot(shown.x - event.x, shown.y - event.y)
            nearest = int(np.argmin(distance))
            where[nearest] = distance[nearest] <= 0.03 * max(float(np.ptp(shown.x)), float(np.ptp(shown.y)), 1e-6)
        elif event.final and event.geometry["type"] == "rect":
            shape = event.geometry
            (left, right), (low, high) = (sorted((shape[f"{axis}0"], shape[f"{axis}1"])) for axis in "xy")
            where = (shown.x >= left) & (shown.x <= right) & (shown.y >= low) & (shown.y <= high)
        elif event.final and len(event.geometry["x"]) > 2:
            corners = np.column_stack([event.geometry["x"], event.geometry["y"]])
            where = np.asarray(Path(corners).contains_points(np.column_stack([shown.x, shown.y])))
        else:
            return
        rows = np.zeros(len(self.session.selected), dtype=np.bool_)
        rows[shown.row[where]] = rows[shown.partner[where]] = True
        self.session.select(rows)
