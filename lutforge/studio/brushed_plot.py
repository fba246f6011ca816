"""A scatter plot of samples whose points can be selected, linked to all others by the session."""

from typing import Any

import numpy as np
from bokeh.events import SelectionGeometry, Tap
from bokeh.models import ColumnDataSource, LassoSelectTool

from lutforge.studio.elements import LINE, extent, frame, plot
from lutforge.studio.plots import Points, colours, drawn, inside_polygon, nearest, rows_at
from lutforge.studio.session import Session
from lutforge.studio.workspace import Workspace

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
        self.figure = plot(title, SELECT, **options)
        self.figure.multi_line("xs", "ys", source=self.lines, color=LINE, width=1.6)
        marks = self.figure.scatter(
            "x", "y", source=self.source, marker="marker", size="size", color="colour", line_width=0.8, fill_alpha=0.7
        )
        marks.selection_glyph = marks.glyph.clone(line_color=LINE, line_width=1.6, fill_alpha=1.0, size=8)
        marks.nonselection_glyph = marks.glyph.clone(fill_alpha=0.18, line_alpha=0.25)
        self.figure.toolbar.active_drag = self.figure.select_one(LassoSelectTool)
        self.figure.on_event(SelectionGeometry, session.guarded(self._geometry))
        self.figure.on_event(Tap, session.guarded(self._tap))

    def show(self, workspace: Workspace, all_points: Points, by: str, size: float = 5.0, key: object = None) -> None:
        """Show other points, decimated. key: what is drawn; where it is another than before, the ranges follow."""
        self.points = all_points
        selected = self.session.selected
        always = np.flatnonzero(selected[all_points.row]) if len(all_points) else None
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
            frame(self.figure, extent(all_points.x), extent(all_points.y))
            self.framed = key
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = all_points.x_label, all_points.y_label
        self.mark()

    def mark(self) -> None:
        """Show the session's selection in this plot."""
        if self.points is None:
            return
        selected = self.session.selected
        row, partner = self.points.row[self.chosen], self.points.partner[self.chosen]
        self.source.selected.indices = np.flatnonzero(selected[row] | selected[partner]).tolist() if len(row) else []

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
