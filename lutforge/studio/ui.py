"""Parts of pages: controls by their labels, figures, and HTML in which all that comes from files is text."""

from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import ColumnDataSource, DataRange1d, LinearColorMapper, Range1d
from bokeh.plotting import figure
from panel.models.plotly import PlotlyPlot

from lutforge.arrays import Array
from lutforge.reports.drawing import GREY, Bars, Dots, Drawing, Line, Lines, Mark, Panel, Raster
from lutforge.reports.tables import Table

HERE = Path(__file__).parent
"""The folder of the studio's style sheets, scripts and templates."""

FILL = {"sizing_mode": "stretch_both", "margin": 0}
SCROLLED: dict[str, Any] = {**FILL, "styles": {"overflow": "auto", "padding-right": "8px"}}
NOTHING = {"–": ""}
"""The options of a list from which nothing can be chosen yet."""
FULL_WIDTH = {"sizing_mode": "stretch_width", "margin": (4, 8)}
TOGETHER = {"sizing_mode": "stretch_width", "margin": 0}
"""Layout of controls that stand together in a column."""
NARROW: dict[str, Any] = {"sizing_mode": "fixed", "width": 230}

TEXT = (HERE / "text.css").read_text(encoding="utf-8")
"""The style of HTML that is shown in panes, each of which has styles of its own."""


class Html(str):
    """HTML that was made here, from texts that were escaped."""


def html(form: str, *values: object) -> Html:
    """HTML of a form with {} in the places of values; each value is escaped, unless it is HTML already."""
    return Html(form.format(*(value if isinstance(value, Html) else escape(str(value)) for value in values)))


def paragraphs(*lines: object) -> Html:
    """A paragraph a line, each escaped."""
    return Html("".join(html("<p>{}</p>", line) for line in lines))


def text(shown: Html | None = None, **options: Any) -> pn.pane.HTML:
    """A pane of HTML, made by `html`."""
    return pn.pane.HTML(shown or "", stylesheets=[TEXT], **{**FULL_WIDTH, **options})


def table(shown: Table) -> Html:
    """An HTML table; all cells are escaped."""
    head = "".join(html("<th scope='col'>{}</th>", cell or Html("&nbsp;")) for cell in shown.header)
    body = "".join("<tr>" + "".join(html("<td>{}</td>", cell) for cell in row) + "</tr>" for row in shown.rows)
    return html("<h2>{}</h2><table><tr>{}</tr>{}</table>", shown.caption, Html(head), Html(body))


def slider(label: str, value: float, start: float, end: float, step: float = 0.01, **more: Any) -> pmui.FloatSlider:
    """A slider that the keyboard moves, too."""
    control = pmui.FloatSlider(
        label=label, value=value, start=start, end=end, step=step, size="small", **{**FULL_WIDTH, **more}
    )
    control.usual = value  # a double click sets the slider to it
    control._priority_changes = ["value"]  # without Panel's pause of 50 ms, by which the picture would lag
    control._busy__ignore = ["value"]  # and the news that the server is busy
    return control


def select(label: str, options: Any, **more: Any) -> pmui.Select:
    """A list to choose from."""
    return pmui.Select(label=label, options=options, size="small", **{**FULL_WIDTH, "margin": (8, 8), **more})


def entry(label: str, **more: Any) -> pmui.TextInput:
    """A line to write into."""
    return pmui.TextInput(label=label, size="small", **{**FULL_WIDTH, "margin": (8, 8), **more})


def checkbox(label: str, value: bool = False) -> pmui.Checkbox:
    """A box to tick."""
    return pmui.Checkbox(label=label, value=value, **FULL_WIDTH)


def written(line: pmui.TextInput) -> str:
    """The text in a line, whether or not it was finished with the enter key."""
    return str(line.value_input or line.value or "").strip()


def set_possible(control: Any, value: Any) -> None:
    """Let a control show a value, as far as it can: a list one of its options, a slider what lies within its ends."""
    if hasattr(control, "options"):
        options = control.options.values() if isinstance(control.options, dict) else control.options
        if value in options:
            control.value = value
    elif hasattr(control, "start"):
        control.value = min(max(value, control.start), control.end)
    elif hasattr(control, "value_input"):
        control.param.update(value=value, value_input=value)
    else:
        control.value = value


def offer(choice: pmui.Select, names: Iterable[str]) -> None:
    """Offer these names; what is chosen stays where it is one of them, else the first is chosen."""
    offered = list(names)
    choice.options = offered or NOTHING
    if choice.value not in offered:
        choice.value = offered[0] if offered else ""


def plot(title: str, tools: str = "pan,wheel_zoom,box_zoom,reset,save", **options: Any) -> Any:
    """An empty Bokeh figure that fills its place and is saved as PNG by its tools."""
    drawing = figure(
        title=title, tools=tools, toolbar_location="right", sizing_mode="stretch_both", min_width=160, min_height=140,
        min_border=4, **options,
    )  # fmt: skip
    drawing.toolbar.logo = None
    return drawing


def hex_colours(rgb: Array) -> list[str]:
    """Encoded colours (n, 3) in [0, 1] as "#rrggbb"."""
    codes = np.rint(np.clip(rgb, 0.0, 1.0) * 255).astype(np.int64)
    return [f"#{value:06x}" for value in (codes[:, 0] << 16) | (codes[:, 1] << 8) | codes[:, 2]]


class Figures:
    """The place of a drawing in the page. Panels of one kind stay as they are, and show other data."""

    def __init__(self) -> None:
        self.layout = pn.Column(**FILL)
        self._kinds: object = None
        self._panels: list[list[_BokehPanel]] = []

    def show(self, drawing: Drawing | None, missing: str = "") -> None:
        """Show a drawing; None: a sentence in its place."""
        rows = () if drawing is None else drawing.rows
        kinds = [[[_glyph(mark)[1:] for mark in panel.marks] for panel in row] for row in rows]
        if kinds != self._kinds or not rows:
            self._kinds = kinds
            self._panels = [[_BokehPanel(panel) for panel in row] for row in rows]
            self.layout[:] = [pn.Row(*(panel.figure for panel in row), **FILL) for row in self._panels]
        if not rows and missing:
            self.layout[:] = [text(paragraphs(missing))]
        for row_panels, panels in zip(self._panels, rows, strict=True):
            for shown, panel in zip(row_panels, panels, strict=True):
                shown.show(panel)


class _BokehPanel:
    def __init__(self, panel: Panel) -> None:
        self.mapper = LinearColorMapper(palette="Cividis256", low=0.0, high=1.0)
        ranges = {
            name: DataRange1d(range_padding=0 if panel.bare else 0.1) if reach is None else Range1d(*reach)
            for name, reach in (("x_range", panel.x_range), ("y_range", panel.y_range))
        }
        self.figure = plot(panel.title, match_aspect=panel.equal, **ranges)
        self.figure.xaxis.ticker.desired_num_ticks = 4
        if panel.bare:
            self.figure.axis.visible = self.figure.grid.visible = False
        self.sources = []
        for mark in panel.marks:
            columns, glyph, options = _glyph(mark, self.mapper)
            self.sources.append(ColumnDataSource(columns))
            getattr(self.figure, glyph)(source=self.sources[-1], **options)
        if self.figure.legend:
            place = "bottom_right" if isinstance(panel.marks[0], Line) else "top_right"
            self.figure.legend.update(padding=2, margin=4, background_fill_alpha=0.5, location=place)

    def show(self, panel: Panel) -> None:
        self.mapper.update(low=panel.scale[0], high=panel.scale[1])
        for mark, source in zip(panel.marks, self.sources, strict=True):
            source.data = _glyph(mark)[0]
        self.figure.title.text = panel.title
        self.figure.xaxis.axis_label = panel.x
        self.figure.yaxis.axis_label = panel.y
        for axis, reach in ((self.figure.x_range, panel.x_range), (self.figure.y_range, panel.y_range)):
            if reach is not None:
                axis.update(start=reach[0], end=reach[1])


def _glyph(mark: Mark, mapper: LinearColorMapper | None = None) -> tuple[dict[str, Any], str, dict[str, Any]]:
    """The columns of a mark, its Bokeh glyph, and the options of that, which tell marks of one kind."""
    label = getattr(mark, "label", "")
    named = {"legend_label": label} if label else {}
    columns: dict[str, Any]
    match mark:
        case Line():
            look = {"color": mark.colour, "line_dash": mark.dash, "line_width": mark.width}
            columns = {"x": mark.x, "y": mark.y}
            return columns, "line", {**look, **named}
        case Lines():
            columns = {"xs": [curve[:, 0] for curve in mark.curves], "ys": [curve[:, 1] for curve in mark.curves]}
            return columns, "multi_line", {"color": mark.colour, "line_width": 0.9, "alpha": 0.8}
        case Dots():
            columns = {"x": mark.points[:, 0], "y": mark.points[:, 1]}
            look = {"color": mark.colour, "size": mark.size, "marker": mark.marker, "line_width": 1.5}
            return columns, "scatter", {**look, "fill_alpha": 0.0}
        case Raster():
            height, width = mark.values.shape[:2]
            size = mark.size or (width, height)
            image = mark.values
            place = {"x": [0], "y": [0], "dw": [size[0]], "dh": [size[1]]}
            if image.ndim == 2:
                return {"image": [image[::-1]], **place}, "image", {"color_mapper": mapper}
            codes = np.full((height, width, 4), 255, dtype=np.uint8)
            codes[..., :3] = np.rint(np.clip(image, 0.0, 1.0) * 255)
            words = codes.view(np.uint32)[..., 0]  # RGBA, as Bokeh takes them
            return {"image": [words[::-1]], **place}, "image_rgba", {}
        case Bars():
            columns = {"left": mark.left, "right": mark.right, "bottom": mark.bottom, "top": mark.top}
            return columns, "quad", {"fill_color": mark.colour, "fill_alpha": 0.6, "line_color": None, **named}
        case _:
            raise TypeError(f"{type(mark).__name__}: drawn in files alone")


class Space:
    """A scene in three dimensions, turned and zoomed by the mouse: Panel's copy of plotly.js, which WebGL draws."""

    def __init__(self) -> None:
        saved = {"format": "png", "scale": 2}
        options = {"displaylogo": False, "responsive": True, "toImageButtonOptions": saved}
        self.plot = PlotlyPlot(config=options, sizing_mode="stretch_both")
        self.layout = pn.pane.Bokeh(self.plot, **FILL)

    def show(self, title: str, traces: list[dict[str, Any]], axes: tuple[str, str, str]) -> None:
        """Show plotly's traces; the axes' names are of x, y, z, of which z is up."""
        scene: dict[str, Any] = {
            "aspectmode": "cube",
            "camera": {"eye": {"x": 1.75, "y": -1.75, "z": 1.0}, "center": {"x": 0.0, "y": 0.0, "z": -0.1}},
        }
        for axis, name in zip("xyz", axes, strict=True):
            scene[f"{axis}axis"] = {"title": {"text": name}, "color": GREY, "gridcolor": GREY, "zeroline": False}
        self.plot.layout = {
            "title": {"text": title, "font": {"size": 14}, "x": 0.01, "xanchor": "left"},
            "font": {"color": GREY}, "showlegend": False,
            "paper_bgcolor": "rgba(0,0,0,0)", "margin": {"l": 0, "r": 0, "t": 30, "b": 0}, "uirevision": "kept",
            "scene": scene,
        }  # fmt: skip
        self.plot.data_sources = [ColumnDataSource() for _ in traces]
        self.plot.data = [{"hoverinfo": "skip", **trace} for trace in traces]
        self.plot._render_count += 1


def lines_in_space(curves: Array, colour: str = GREY, width: float = 1.0) -> dict[str, Any]:
    """A trace of lines between points (n, k, 3) in the order of the axes."""
    gaps = np.concatenate([curves, np.full((len(curves), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    x, y, z = ([None if np.isnan(value) else value for value in axis] for axis in gaps.T.tolist())
    return {"type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "line": {"color": colour, "width": width}}


def dots_in_space(points: Array, colour: str | list[str], symbol: str = "circle") -> dict[str, Any]:
    """A trace of points (n, 3) in the order of the axes."""
    x, y, z = points.T.tolist()
    marker = {"color": colour, "size": 2.0, "symbol": symbol}
    return {"type": "scatter3d", "mode": "markers", "x": x, "y": y, "z": z, "marker": marker}
