"""Drawings as Bokeh's figures in the page: zoomed, hovered over, saved; what changes is drawn in place."""

from typing import Any

import numpy as np
import panel as pn
from bokeh.models import (
    ColorBar,
    ColumnDataSource,
    CustomAction,
    CustomJS,
    DataRange1d,
    HoverTool,
    LinearColorMapper,
    Range1d,
)
from bokeh.plotting import figure
from panel.models.plotly import PlotlyPlot

from lutforge.arrays import Array
from lutforge.report.drawing import GREY, Arrows, Bars, Dots, Drawing, Labels, Line, Lines, Mark, Panel, Raster
from lutforge.studio.elements import paragraphs, text

FILL = {"sizing_mode": "stretch_both", "margin": 0}
PALETTE = "Cividis256"

_SAVE_SVG = """
const view = Bokeh.index.find_one_by_id(drawing.id);
view.export("svg").to_blob().then((blob) => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = `${(drawing.title.text || "plot").replace(/[^\\w-]+/g, "_")}.svg`;
  link.click();
});
"""


def plot(title: str, tools: str = "pan,wheel_zoom,box_zoom,reset,save", **options: Any) -> Any:
    """An empty Bokeh figure that fills its place and is saved as PNG or SVG by its tools."""
    drawing = figure(
        title=title, tools=tools, toolbar_location="right", sizing_mode="stretch_both", min_width=160, min_height=140,
        min_border=4, **options,
    )  # fmt: skip
    drawing.toolbar.logo = None
    svg = CustomJS(args={"drawing": drawing}, code=_SAVE_SVG)
    drawing.add_tools(CustomAction(description="Save as SVG", icon="text_align_left", callback=svg))
    return drawing


def hex_colours(rgb: Array) -> list[str]:
    """Encoded colours (n, 3) in [0, 1] as "#rrggbb"."""
    codes = np.rint(np.clip(rgb, 0.0, 1.0) * 255).astype(np.int64)
    return [f"#{value:06x}" for value in (codes[:, 0] << 16) | (codes[:, 1] << 8) | codes[:, 2]]


class Figures:
    """The place of a drawing in the page. Panels of one kind stay as they are, and show other data."""

    def __init__(self, **options: Any) -> None:
        self.layout = pn.Column(**{**FILL, **options})
        self._kinds: object = None
        self._panels: list[_BokehPanel] = []

    def show(self, drawing: Drawing | None, missing: str = "") -> None:
        """Show a drawing; None: a sentence in its place."""
        if drawing is None:
            self._kinds, self._panels = None, []
            self.layout[:] = [text(paragraphs(missing))] if missing else []
            return
        kinds = [[tuple(map(_kind, panel.marks)) for panel in row] for row in drawing.rows]
        if kinds != self._kinds:
            together: dict[str, Any] = {}  # pictures beside each other are moved and zoomed as one
            rows = [[_BokehPanel(panel, together) for panel in row] for row in drawing.rows]
            self._kinds, self._panels = kinds, [panel for row in rows for panel in row]
            self.layout[:] = [pn.Row(*(panel.figure for panel in row), **FILL) for row in rows]
        for held, panel in zip(self._panels, drawing.panels, strict=True):
            held.show(panel)


def _kind(mark: Mark) -> tuple[object, ...]:
    """What two marks have in common of which one can take the other's place."""
    colour = getattr(mark, "colour", "")
    look = [getattr(mark, name, "") for name in ("label", "marker", "dash")]
    return type(mark), *look, colour if isinstance(colour, str) else "", isinstance(mark, Raster) and mark.values.ndim


class _BokehPanel:
    def __init__(self, panel: Panel, together: dict[str, Any]) -> None:
        self.mapper = LinearColorMapper(palette=PALETTE, low=0.0, high=1.0, nan_color=GREY)
        if panel.bare and not together:
            together |= {name: DataRange1d(range_padding=0) for name in ("x_range", "y_range")}
        ranges = together if panel.bare else {
            name: DataRange1d() if reach is None else Range1d(*reach)
            for name, reach in (("x_range", panel.x_range), ("y_range", panel.y_range))
        }  # fmt: skip
        self.figure = plot(panel.title, match_aspect=panel.equal, **ranges)
        self.figure.xaxis.ticker.desired_num_ticks = 4
        if panel.bare:
            self.figure.axis.visible = self.figure.grid.visible = False
        self.sources = [ColumnDataSource(_data(mark)) for mark in panel.marks]
        for mark, source in zip(panel.marks, self.sources, strict=True):
            self._add(mark, source)
        if panel.scale_name.strip():
            self.figure.add_layout(ColorBar(color_mapper=self.mapper, width=6), "right")
        if self.figure.legend:
            place = "bottom_right" if isinstance(panel.marks[0], Line) else "top_right"
            self.figure.legend.update(padding=2, margin=4, background_fill_alpha=0.5, location=place)

    def show(self, panel: Panel) -> None:
        self.mapper.update(low=panel.scale[0], high=panel.scale[1])
        for mark, source in zip(panel.marks, self.sources, strict=True):
            source.data = _data(mark)
        self.figure.title.text = panel.title
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = panel.x, panel.y
        for axis, reach in ((self.figure.x_range, panel.x_range), (self.figure.y_range, panel.y_range)):
            if reach is not None:
                axis.update(start=reach[0], end=reach[1])

    def _add(self, mark: Mark, source: ColumnDataSource) -> None:
        drawing, named = self.figure, {"source": source}
        if label := getattr(mark, "label", ""):
            named["legend_label"] = label
        by_value = {"field": "value", "transform": self.mapper}
        match mark:
            case Line():
                drawing.line("x", "y", color=mark.colour, line_dash=mark.dash, line_width=mark.width, **named)
            case Lines():
                drawing.multi_line("xs", "ys", color=mark.colour, line_width=0.9, alpha=0.8, **named)
            case Dots():
                colour = "colour" if mark.values is None else by_value
                drawing.scatter(
                    "x", "y", color=colour, size=mark.size, marker=mark.marker,
                    fill_alpha=0.0 if mark.marker == "square" else 1.0, line_width=1.5, **named,
                )  # fmt: skip
            case Arrows():
                drawing.segment("x", "y", "x1", "y1", color=by_value, line_width=1.8, **named)
                drawing.scatter("x1", "y1", color=by_value, size=3, **named)
            case Raster() if mark.values.ndim == 2:
                drawing.image("image", x=0, y=0, dw="width", dh="height", color_mapper=self.mapper, **named)
                drawing.add_tools(HoverTool(tooltips=[("value", "@image{0.0000}")]))
            case Raster():
                drawing.image_rgba("image", x=0, y=0, dw="width", dh="height", **named)
            case Bars():
                drawing.quad(
                    left="left", right="right", bottom="bottom", top="top", fill_color=mark.colour, fill_alpha=0.6,
                    line_color=None, **named,
                )  # fmt: skip
            case Labels():
                drawing.text("x", "y", text="text", text_align="center", text_font_size="0.7em", **named)


def _data(mark: Mark) -> dict[str, Any]:
    """The columns of a mark."""
    match mark:
        case Line():
            return {"x": mark.x, "y": mark.y}
        case Lines():
            return {"xs": [one[:, 0] for one in mark.curves], "ys": [one[:, 1] for one in mark.curves]}
        case Dots():
            colour = [mark.colour] * len(mark.points) if isinstance(mark.colour, str) else hex_colours(mark.colour)
            own = {"colour": colour} if mark.values is None else {"value": mark.values}
            return {"x": mark.points[:, 0], "y": mark.points[:, 1], **own}
        case Arrows():
            ends = {"x": mark.start[:, 0], "y": mark.start[:, 1], "x1": mark.end[:, 0], "y1": mark.end[:, 1]}
            return {**ends, "value": mark.values}
        case Raster():
            height, width = mark.values.shape[:2]
            size = mark.size or (width, height)
            image: Any = mark.values
            if image.ndim == 3:  # as the RGBA words of Bokeh
                codes = np.full((height, width, 4), 255, dtype=np.uint8)
                codes[..., :3] = np.rint(np.clip(image, 0.0, 1.0) * 255)
                image = codes.view(np.uint32)[..., 0]
            return {"image": [image[::-1]], "width": [size[0]], "height": [size[1]]}
        case Bars():
            return {"left": mark.left, "right": mark.right, "bottom": mark.bottom, "top": mark.top}
        case Labels():
            return {"x": mark.points[:, 0], "y": mark.points[:, 1], "text": list(mark.texts)}


class Space:
    """A scene in three dimensions, turned and zoomed by the mouse: Panel's copy of plotly.js, which WebGL draws."""

    def __init__(self) -> None:
        saved = {"format": "png", "scale": 2}
        options = {"displaylogo": False, "responsive": True, "toImageButtonOptions": saved}
        self.plot = PlotlyPlot(config=options, sizing_mode="stretch_both")
        self.layout = pn.pane.Bokeh(self.plot, **FILL)

    def show(self, title: str, traces: list[dict[str, Any]], axes: tuple[str, str, str]) -> None:
        """Show plotly's traces; the axes' names are of x, y, z, of which z is up."""
        named = zip(("xaxis", "yaxis", "zaxis"), axes, strict=True)
        scene = {
            key: {"title": {"text": name}, "color": GREY, "gridcolor": GREY, "zeroline": False} for key, name in named
        }
        camera = {"eye": {"x": 1.6, "y": -1.6, "z": 0.9}}
        self.plot.layout = {
            "title": {"text": title, "font": {"size": 14}}, "font": {"color": GREY}, "showlegend": False,
            "paper_bgcolor": "rgba(0,0,0,0)", "margin": {"l": 0, "r": 0, "t": 30, "b": 0}, "uirevision": "kept",
            "scene": {**scene, "aspectmode": "cube", "camera": camera},
        }  # fmt: skip
        self.plot.data_sources = [ColumnDataSource() for _ in traces]
        self.plot.data = [{"hoverinfo": "skip", **trace} for trace in traces]
        self.plot._render_count += 1


def lines_in_space(ends: Array, colour: str = GREY, width: float = 1.0) -> dict[str, Any]:
    """A trace of lines between points (n, k, 3) in the order of the axes."""
    gaps = np.concatenate([ends, np.full((len(ends), 1, 3), np.nan)], axis=1).reshape(-1, 3)
    x, y, z = ([None if np.isnan(value) else value for value in axis] for axis in gaps.T.tolist())
    return {"type": "scatter3d", "mode": "lines", "x": x, "y": y, "z": z, "line": {"color": colour, "width": width}}


def dots_in_space(points: Array, colour: str | list[str], size: float = 2.0, symbol: str = "circle") -> dict[str, Any]:
    """A trace of points (n, 3) in the order of the axes."""
    x, y, z = points.T.tolist()
    marker = {"color": colour, "size": size, "symbol": symbol}
    return {"type": "scatter3d", "mode": "markers", "x": x, "y": y, "z": z, "marker": marker}
