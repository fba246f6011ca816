"""Samples: linked plots, filters, marks by hand, named groups of outliers (thesis A.3, A.3.1)."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import panel as pn
from bokeh.events import SelectionGeometry, Tap
from bokeh.models import ColumnDataSource, LassoSelectTool, Range1d

from lutforge.arrays import Mask
from lutforge.report.drawing import GREY, Dots, Drawing, Panel, Raster
from lutforge.report.figures import chromaticity_outlines, cube_edges
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.bokeh_figure import FILL, Figures, Space, dots_in_space, hex_colours, lines_in_space, plot
from lutforge.studio.elements import (
    NOTHING,
    TOGETHER,
    WIDE,
    Html,
    checkbox,
    entry,
    html,
    limits,
    offer,
    paragraphs,
    select,
    text,
    ticks,
    written,
)
from lutforge.studio.plots import (
    COLOURS,
    OF_PAIRS,
    PLOTS,
    Points,
    colours,
    colours_in_space,
    drawn,
    in_chromaticity_diagram,
    inside_polygon,
    nearest,
    points,
    rows_at,
    tristimulus,
)
from lutforge.studio.session import Session
from lutforge.studio.workspace import COLUMNS, Workspace, WorkspaceError

SELECT = "lasso_select,box_select,pan,wheel_zoom,reset,save"


class BrushedPlot:
    """A scatter plot of samples whose points can be selected; the session hears of it, and tells all others."""

    def __init__(self, session: Session, title: str = "", **options: Any) -> None:
        self.session = session
        self.points: Points | None = None
        self.framed: object = ""
        self.chosen = np.zeros(0, dtype=np.intp)
        self.source = ColumnDataSource({name: [] for name in ("x", "y", "colour", "marker", "size")})
        self.lines = ColumnDataSource({"xs": [], "ys": []})
        # Ranges are set as points are shown: an empty plot has none of its own.
        self.figure = plot(title, SELECT, **{"x_range": Range1d(0, 1), "y_range": Range1d(0, 1), **options})
        self.figure.multi_line("xs", "ys", source=self.lines, color=GREY, width=1.6)
        marks = self.figure.scatter(
            "x", "y", source=self.source, marker="marker", size="size", color="colour", line_width=0.8, fill_alpha=0.7
        )
        marks.selection_glyph = marks.glyph.clone(line_color=GREY, line_width=1.6, fill_alpha=1.0, size=8)
        marks.nonselection_glyph = marks.glyph.clone(fill_alpha=0.18, line_alpha=0.25)
        self.figure.toolbar.active_drag = self.figure.select_one(LassoSelectTool)
        self.figure.on_event(SelectionGeometry, session.guarded(self._geometry))
        self.figure.on_event(Tap, session.guarded(self._tap))

    def show(self, workspace: Workspace, all_points: Points, by: str, size: float = 5.0, key: object = None) -> None:
        """Show other points, decimated. key: what is drawn; where it is another than before, the ranges follow."""
        self.points = all_points
        always = np.flatnonzero(self.session.selected[all_points.row]) if len(all_points) else None
        self.chosen = drawn(len(all_points), always)
        row, partner = all_points.row[self.chosen], all_points.partner[self.chosen]
        out = workspace.outliers[row] | workspace.outliers[partner]
        self.source.selected.indices = []
        self.source.data = {
            "x": all_points.x[self.chosen],
            "y": all_points.y[self.chosen],
            "colour": colours(workspace, all_points, self.chosen, by),
            "marker": np.where(out, "x", "circle").tolist(),
            "size": np.full(len(row), size),
        }
        self.lines.data = {"xs": [x for x, _ in all_points.curves], "ys": [y for _, y in all_points.curves]}
        if self.framed is not None and self.framed != key:
            for axis, values in ((self.figure.x_range, all_points.x), (self.figure.y_range, all_points.y)):
                low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
                space = 0.04 * max(high - low, 1e-3)
                low, high = low - space, high + space
                axis.update(start=low, end=high, reset_start=low, reset_end=high)
            self.framed = key
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = all_points.x_label, all_points.y_label
        self.mark()

    def mark(self) -> None:
        """Show the session's selection in this plot."""
        if self.points is not None:
            selected = self.session.selected
            row, partner = self.points.row[self.chosen], self.points.partner[self.chosen]
            chosen = np.flatnonzero(selected[row] | selected[partner]).tolist() if len(row) else []
            self.source.selected.indices = chosen

    def _geometry(self, event: SelectionGeometry) -> None:
        if not event.final or self.points is None:
            return
        shape, data = event.geometry, self.points
        if shape["type"] == "poly":
            where = inside_polygon(data.x, data.y, shape["x"], shape["y"])
        elif shape["type"] == "rect":
            low_x, high_x = sorted((shape["x0"], shape["x1"]))
            low_y, high_y = sorted((shape["y0"], shape["y1"]))
            where = (data.x >= low_x) & (data.x <= high_x) & (data.y >= low_y) & (data.y <= high_y)
        else:
            return
        self.session.select(rows_at(data, where, len(self.session.selected)))

    def _tap(self, event: Tap) -> None:
        if self.points is None or event.x is None or event.y is None or len(self.points) == 0:
            return
        reach = 0.03 * max(float(np.ptp(self.points.x)), float(np.ptp(self.points.y)), 1e-6)
        where = nearest(self.points, float(event.x), float(event.y), reach)
        self.session.select(rows_at(self.points, where, len(self.session.selected)))


class SamplesPage:
    """The second step."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self._seen: SampleSet | None = None
        plots = {title: key for key, title in PLOTS.items()}
        self.first = select("Left plot", plots, value="srgb_btf")
        self.second = select("Right plot", plots, value="srgb_raw")
        self.channel = select("Channel", {"Red": 0, "Green": 1, "Blue": 2}, value=1)
        self.by = select("Colour by", list(COLOURS))
        self.inliers = checkbox("Inliers only")
        self.space_of = select("In xy and XYZ", ["JPEG colours", "transformed RAW", "both"])
        self.picture_of = select("Picture of the shot", NOTHING)
        views = (self.first, self.second, self.channel, self.by, self.space_of, self.picture_of, self.inliers)
        session.watch(self.refresh, *views)
        self.limits = {name: limits(column.title, column.reach, column.step) for name, column in COLUMNS.items()}
        session.watch(self._filter, *self.limits.values())
        self.counts = text()
        self.words = entry("Select row, shot or patch")
        session.watch(self._find, self.words)
        self.group, self.groups = entry("Outlier group", placeholder="name"), ticks("Groups in effect")
        session.watch(self._groups, self.groups)
        small = {"sizing_mode": "stretch_width", "margin": 2}
        marks = {"Outliers": lambda: self._mark(1), "Keep": lambda: self._mark(-1), "Unmark": lambda: self._mark(0)}
        named = {"Save group": self._save_group, "Delete group": self._delete}
        rows = [
            pn.Row(*(session.button(label, action, **small) for label, action in buttons.items()), **WIDE)
            for buttons in (marks, named)
        ]
        self.controls = [
            pn.Column(*views, **TOGETHER),
            pn.Column(*self.limits.values(), self.counts, **TOGETHER),
            pn.Column(self.words, rows[0], self.group, rows[1], self.groups, **WIDE),
        ]
        self.left, self.right = (BrushedPlot(session) for _ in range(2))
        ranges = {"x_range": Range1d(-0.08, 0.92), "y_range": Range1d(-0.03, 0.87)}
        self.chromaticity = BrushedPlot(session, "CIE xy: inliers ●, outliers ×", **ranges)
        self.chromaticity.framed = None
        for outline in chromaticity_outlines():
            self.chromaticity.figure.line(*outline.T, color=GREY, width=1.0)
        self.space, self.picture, self.selection = Space(), Figures(), text(styles={"overflow": "auto"}, height=110)
        chosen = pn.Column(self.picture.layout, self.selection, **FILL)
        self.main = pn.Column(
            pn.Row(self.left.figure, self.right.figure, **FILL),
            pn.Row(self.chromaticity.figure, self.space.layout, chosen, **FILL), **FILL,
        )  # fmt: skip

    # --- what is shown -----------------------------------------------------------------------------------------------

    def refresh(self) -> None:
        """Everything, from the session's workspace."""
        if self.session.history is None:
            return
        workspace = self.session.workspace
        if self._seen is not workspace.samples:
            self._seen = workspace.samples
            if self.first.value in (OF_PAIRS[0], "saturation"):  # without pairs, what the filters cut
                paired = workspace.pairs is not None
                self.first.value, self.by.value = (OF_PAIRS[0], COLOURS[0]) if paired else ("saturation", COLOURS[1])
            if not workspace.has_raw:
                self.second.value = "saturation"
        offer(self.picture_of, [account.shot for account in self.session.opened.accounts if account.cells is not None])
        self._set_controls(workspace)
        for drawing, choice in ((self.left, self.first), (self.right, self.second)):
            shown = points(workspace, choice.value, self.channel.value)
            key = (choice.value, self.channel.value, workspace.samples)
            drawing.show(workspace, self._chosen(workspace, shown), self.by.value, key=key)
            drawing.figure.title.text = shown.missing or PLOTS[choice.value]
        by = "residual" if self.by.value == "residual" else "own colour"
        shown = self._chosen(workspace, in_chromaticity_diagram(workspace, self.space_of.value))
        self.chromaticity.show(workspace, shown, by, 4.0)
        self._draw_space(workspace)
        self.mark()

    def _chosen(self, workspace: Workspace, shown: Points) -> Points:
        """The points, those of inliers alone where that is ticked."""
        if not self.inliers.value:
            return shown
        return shown.select(~(workspace.outliers[shown.row] | workspace.outliers[shown.partner]))

    def _draw_space(self, workspace: Workspace) -> None:
        """Inliers in their own colours and outliers, red, in CIE XYZ, within the cube of sRGB."""
        linear, row = colours_in_space(workspace, self.space_of.value)
        kept = drawn(len(row))
        xyz, row = tristimulus(linear[kept]), row[kept]
        out = workspace.outliers[row]
        traces = [lines_in_space(tristimulus(cube_edges()))]
        traces.append(dots_in_space(xyz[~out], hex_colours(workspace.samples.srgb[row[~out]])))
        traces += [] if self.inliers.value else [dots_in_space(xyz[out], "#e0503c", symbol="x")]
        self.space.show("CIE XYZ: outliers red", traces, ("X", "Z", "Y"))

    def mark(self) -> None:
        """The selection, in all plots, in the picture of its shot, and in words."""
        for drawing in (self.left, self.right, self.chromaticity):
            drawing.mark()
        if self.session.history is not None:
            self._draw_picture(self.session.workspace)
            self.selection.object = self._describe()

    def _draw_picture(self, workspace: Workspace) -> None:
        """Draw a shot, that of the first selected sample or the chosen one, with frames round its samples."""
        samples, selected = workspace.samples, self.session.selected
        chosen = self.picture_of.value
        if selected.any() and not (selected & (samples.shot == chosen)).any():
            chosen = str(samples.shot[np.flatnonzero(selected)[0]])
        accounts = {account.shot: account for account in self.session.opened.accounts}
        account, rows = accounts.get(chosen), samples.shot == chosen
        if account is None or account.cells is None or len(account.places) != rows.sum():
            self.picture.show(None, "Open the folder of the shots to see where samples are.")
            return
        picture = account.cells.picture / 255
        places = (account.places * [1, -1] + [0, 1]) * picture.shape[1::-1]

        def frames(which: Mask, colour: str, size: float) -> Dots:
            return Dots(places[which[rows]], colour, marker="square", size=size)

        out = workspace.outliers
        marks = (
            Raster(picture),
            frames(~out & ~selected, "#ffffff", 5),
            frames(out, "#ff8c00", 7),
            frames(selected, "#00e5ff", 11),
        )
        title = f"{chosen}: outliers orange, selected blue"
        self.picture.show(Drawing(((Panel(title, marks, bare=True, equal=True),),)))

    def _describe(self) -> Html:
        rows = np.flatnonzero(self.session.selected)
        if len(rows) == 0:
            return paragraphs("No sample selected: draw a lasso or a box in a plot, click a point, or name a row.")
        samples, workspace = self.session.workspace.samples, self.session.workspace
        out = int(workspace.outliers[rows].sum())
        lines = [html("<h2>{} selected, {} of them outliers</h2>", f"{len(rows):,}", f"{out:,}")]
        for row in rows[:8]:
            codes = ", ".join(f"{255 * value:.0f}" for value in samples.srgb[row])
            raw = "" if not workspace.has_raw else "; RAW " + ", ".join(f"{value:.3f}" for value in samples.raw[row])
            where = f"row {row}, shot {samples.shot[row]}, patch {samples.patch[row]}"
            setting = f"{samples.style[row]}/{samples.white_balance[row]}: JPEG {codes}{raw}"
            (colour,) = hex_colours(samples.srgb[row : row + 1])
            lines.append(html("<p><i class=colour style='background:{}'></i>{}<br>{}</p>", colour, where, setting))
        lines += [html("<p>and {} more</p>", f"{len(rows) - 8:,}")] if len(rows) > 8 else []
        return Html("".join(lines))

    def _set_controls(self, workspace: Workspace) -> None:
        for name, slider in self.limits.items():
            slider.value = workspace.limits.get(name, COLUMNS[name].usual)
        self.groups.options = list(workspace.groups)
        self.groups.value = [name for name, group in workspace.groups.items() if group.active]
        found = ", ".join(f"{COLUMNS[name].title.lower()} {rows.sum():,}" for name, rows in workspace.filtered.items())
        kept = int((~workspace.outliers).sum())
        self.counts.object = paragraphs(
            f"{kept:,} of {len(workspace.samples):,} samples are inliers. Outside the limits of {found}; by hand, "
            f"groups and shots {int(workspace.removed.sum()):,}."
        )

    # --- what is done ------------------------------------------------------------------------------------------------

    def _filter(self) -> None:
        if self.session.history is None:
            return
        wanted = {}
        for name, slider in self.limits.items():
            low, high = (float(value) for value in slider.value)
            if (low, high) != COLUMNS[name].usual:
                wanted[name] = (low, high)
        if wanted != self.session.workspace.limits:
            self.session.change(replace(self.session.workspace, limits=wanted))

    def _picked(self) -> Mask:
        if not self.session.workspace.has_raw:
            raise WorkspaceError("the colours of a bracket are not chosen by hand: leave pictures out under Shots")
        if not self.session.selected.any():
            raise WorkspaceError("no samples selected: draw a lasso in a plot, or name rows")
        return self.session.selected

    def _mark(self, mark: int) -> None:
        rows = self._picked()
        self.session.change(self.session.workspace.mark(rows, mark))
        done = {1: "marked as outliers", -1: "kept by hand", 0: "no longer marked"}[mark]
        self.session.say(f"{int(rows.sum()):,} samples {done}")

    def _save_group(self) -> None:
        workspace = self.session.workspace
        rows = self.session.selected if self.session.selected.any() else workspace.outliers
        name = written(self.group)
        self.session.change(workspace.with_group(name, rows))
        self.session.say(f"outlier group {name}: {int(rows.sum()):,} samples, in effect")

    def _groups(self) -> None:
        if self.session.history is None:
            return
        workspace = self.session.workspace
        if set(self.groups.value) != {name for name, group in workspace.groups.items() if group.active}:
            self.session.change(workspace.with_active_groups(self.groups.value))

    def _delete(self) -> None:
        name = written(self.group)
        self.session.change(self.session.workspace.without_group(name))
        self.session.say(f"outlier group {name} deleted")

    def _find(self) -> None:
        if self.words.value:
            self.session.select(find_rows(self.session.workspace.samples, self.words.value))


def find_rows(samples: SampleSet, words: str) -> Mask:
    """(n,) rows by number ("12, 40-60"), else by the name of their shot or patch. Raises WorkspaceError: none."""
    words, count = words.strip(), len(samples)
    rows = np.zeros(count, dtype=np.bool_)
    if re.fullmatch(r"[\d\s,-]{1,2000}", words):
        for first, last in re.findall(r"(\d{1,12})(?:\s*-\s*(\d{1,12}))?", words):
            rows[int(first) : int(last or first) + 1] = True
    elif words:
        rows = (samples.shot == words) | (samples.patch == words)
    if not rows.any():
        raise WorkspaceError(f"{words[:60] or 'nothing'}: no such row, shot or patch; rows count from 0 to {count - 1}")
    return rows
