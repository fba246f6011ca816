"""A scatter plot of samples in which points are selected, by a lasso, a box or a click, for all plots at once."""

from typing import Any

import numpy as np
from bokeh.events import SelectionGeometry, Tap
from bokeh.models import ColumnDataSource, LassoSelectTool, Range1d
from matplotlib.path import Path

from lutforge.reports.drawing import GREY, thinned
from lutforge.studio import ui
from lutforge.studio.sample_plots import Points, colours
from lutforge.studio.session import Session
from lutforge.studio.workspace import Workspace

SELECT = "lasso_select,box_select,pan,wheel_zoom,reset,save"
"""The tools of a plot."""
MOST_DRAWN = 4000
"""Points that are drawn of a plot, besides those that are selected."""


class BrushedPlot:
    """A scatter plot of samples whose points can be selected; the session hears of it, and tells all others."""

    def __init__(self, session: Session, title: str = "", **options: Any) -> None:
        self.session = session
        self.points: Points | None = None
        self.framed_key: object = None
        self.drawn = np.zeros(0, dtype=np.intp)
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
        """Show other points, at most MOST_DRAWN and those that are selected. inliers: leave outliers out."""
        out = workspace.outliers[shown.row] | workspace.outliers[shown.partner]
        if inliers:
            shown = shown.select(~out)
            out = out[~out]
        self.points = shown
        self.drawn = thinned(len(shown), MOST_DRAWN)
        if len(shown) > MOST_DRAWN:
            selected = np.flatnonzero(self.session.selected[shown.row])
            self.drawn = np.union1d(self.drawn, selected[thinned(len(selected), MOST_DRAWN)])
        self.source.selected.indices = []
        self.source.data = {
            "x": shown.x[self.drawn],
            "y": shown.y[self.drawn],
            "colour": colours(workspace, shown, self.drawn, by),
            "marker": np.where(out[self.drawn], "x", "circle").tolist(),
            "size": np.full(len(self.drawn), size),
        }
        self.lines.data = {"xs": [x for x, _ in shown.curves], "ys": [y for _, y in shown.curves]}
        self.figure.xaxis.axis_label = shown.x_label
        self.figure.yaxis.axis_label = shown.y_label

    def frame(self, key: object) -> None:
        """Let the ranges follow the points. key: what is drawn; as long as it is the same, the ranges stay."""
        if self.points is None or key == self.framed_key:
            return
        self.framed_key = key
        for axis, values in ((self.figure.x_range, self.points.x), (self.figure.y_range, self.points.y)):
            low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
            low, high = low - 0.04 * max(high - low, 1e-3), high + 0.04 * max(high - low, 1e-3)
            axis.update(start=low, end=high, reset_start=low, reset_end=high)

    def mark(self) -> None:
        """Show the session's selection in this plot."""
        if self.points is not None:
            selected = self.session.selected[self.points.row] | self.session.selected[self.points.partner]
            self.source.selected.indices = np.flatnonzero(selected[self.drawn]).tolist()

    def _select(self, event: SelectionGeometry | Tap) -> None:
        """Select the points inside a lasso (even-odd rule) or a box, or the point nearest to a click, if it is near."""
        dots = self.points
        if dots is None or len(dots) == 0:
            return
        where = np.zeros(len(dots), dtype=np.bool_)
        if isinstance(event, Tap):
            distance = np.hypot(dots.x - event.x, dots.y - event.y)
            nearest = int(np.argmin(distance))
            where[nearest] = distance[nearest] <= 0.03 * max(float(np.ptp(dots.x)), float(np.ptp(dots.y)), 1e-6)
        elif event.final and event.geometry["type"] == "rect":
            shape = event.geometry
            (left, right), (low, high) = (sorted((shape[f"{axis}0"], shape[f"{axis}1"])) for axis in "xy")
            where = (dots.x >= left) & (dots.x <= right) & (dots.y >= low) & (dots.y <= high)
        elif event.final and len(event.geometry["x"]) > 2:
            corners = np.column_stack([event.geometry["x"], event.geometry["y"]])
            where = np.asarray(Path(corners).contains_points(np.column_stack([dots.x, dots.y])))
        else:
            return
        rows = np.zeros(len(self.session.selected), dtype=np.bool_)
        rows[dots.row[where]] = rows[dots.partner[where]] = True
        self.session.select(rows)
