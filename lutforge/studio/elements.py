"""Elements of the page that Panel has not in this form: a slider with a real label, a wipe, text that is only text."""

from collections.abc import Callable, Sequence
from html import escape
from typing import Any

import numpy as np
import panel as pn
import param
from bokeh.models import Range1d
from bokeh.plotting import figure
from panel.custom import JSComponent

CSS = """
body { margin: 0; background: #f4f5f6; font-family: system-ui, sans-serif; }
"""
TEXT = """
:host { font: 13px/1.35 system-ui, sans-serif; color: #1c2024; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: 2px 6px; border-bottom: 1px solid #e3e5e8; font-variant-numeric: tabular-nums; }
th:first-child, td:first-child { text-align: left; }
h2 { font-size: 13px; margin: 4px 0; }
p { margin: 3px 0; }
"""
NARROW = {"margin": (2, 5)}
WIDTH = 236
"""Pixels of a column of controls."""


class Slider(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """A native range input with its label and value: reached and moved by the keyboard."""

    label = param.String()
    value = param.Number(0.0)
    start = param.Number(0.0)
    end = param.Number(1.0)
    step = param.Number(0.01)
    digits = param.Integer(2)
    unit = param.String()
    greatest = param.String(doc="Shown in place of the greatest value.")
    disabled = param.Boolean(False)
    awaited = param.Boolean(False, doc="Whether a move waits until the one before has been dealt with.")
    dealt_with = param.Integer(0)

    _stylesheets = [  # noqa: RUF012 - Panel's own way to declare it
        """
        label { display: block; font: 12px system-ui, sans-serif; color: #1c2024; }
        label span { float: right; font-variant-numeric: tabular-nums; }
        input { width: 100%; margin: 2px 0 0; accent-color: #0072b2; }
        """
    ]
    _esm = """
    export function render({ model }) {
      const label = document.createElement("label");
      const name = document.createTextNode(model.label);
      const shown = document.createElement("span");
      const input = document.createElement("input");
      input.type = "range";
      label.append(name, shown, input);
      const say = () => {
        const value = Number(input.value);
        const last = model.greatest && value >= model.end - 1e-9;
        shown.textContent = last ? model.greatest : value.toFixed(model.digits) + model.unit;
        input.setAttribute("aria-valuetext", shown.textContent);
      };
      let sent = model.value;
      const set = () => {
        input.min = model.start; input.max = model.end; input.step = model.step;
        input.value = model.value; input.disabled = model.disabled; say(); sent = model.value;
      };
      let busy = false, timer;
      const free = () => { clearTimeout(timer); busy = false; send(); };
      const send = () => {
        const value = Number(input.value);
        if (busy || value === sent) return;
        busy = true; sent = value; model.value = value;
        timer = setTimeout(free, model.awaited ? 5000 : 40);
      };
      model.on("dealt_with", free);
      input.addEventListener("input", () => { say(); send(); });
      for (const name of ["start", "end", "step", "value", "disabled"]) model.on(name, set);
      set();
      return label;
    }
    """

    def __init__(self, label: str, value: float = 0.0, **options: Any) -> None:
        super().__init__(**{"label": label, "value": value, "width": WIDTH, **NARROW, **options})

    def on_move(
        self, guarded: Callable[[Callable[..., None]], Callable[..., None]], callback: Callable[[], None]
    ) -> None:
        """Call back when the slider has moved; while that takes its time, moves between are left out."""

        def moved(event: Any) -> None:
            try:
                callback()
            finally:
                self.dealt_with += 1

        self.awaited = True
        self.param.watch(guarded(moved), "value")


class Wipe(JSComponent):  # type: ignore[misc]  # Panel's classes are seen as Any
    """Two pictures on top of each other: left of the wipe the first, right of it the second."""

    before = param.String()
    after = param.String()
    wipe = param.Number(0.5)
    number = param.Integer(0, doc="Counts the pictures, so that the page can tell that it shows the latest.")
    width_px = param.Integer(940)
    height_px = param.Integer(600)

    _esm = """
    export function render({ model }) {
      const box = document.createElement("div");
      box.style.cssText = `position:relative;background:#2b2e31;overflow:hidden;` +
        `width:${model.width_px}px;height:${model.height_px}px`;
      const fill = "position:absolute;inset:0;width:100%;height:100%;object-fit:contain;";
      const after = document.createElement("img"), before = document.createElement("img");
      const line = document.createElement("div");
      after.alt = "after: the photograph with the target settings";
      before.alt = "before: the photograph as it is";
      after.style.cssText = fill; before.style.cssText = fill;
      line.style.cssText = "position:absolute;top:0;bottom:0;width:2px;background:#fff;opacity:.8";
      box.append(after, before, line);
      const cut = () => {
        const share = 100 * model.wipe;
        before.style.clipPath = `inset(0 ${100 - share}% 0 0)`;
        line.style.left = `${share}%`;
      };
      const show = (image, data) => {
        image.style.visibility = data ? "visible" : "hidden";
        if (data) image.src = data;
      };
      const after_set = () => show(after, model.after), before_set = () => show(before, model.before);
      model.on("after", after_set); model.on("before", before_set); model.on("wipe", cut);
      after.addEventListener("load", () => { after.dataset.number = model.number; });
      after_set(); before_set(); cut();
      return box;
    }
    """


def text(html: str = "", **options: Any) -> pn.pane.HTML:
    """A pane of HTML that is made here; whatever comes from files goes through `escape`."""
    return pn.pane.HTML(html, stylesheets=[TEXT], **{"margin": (2, 5), **options})


def table(header: Sequence[str], rows: Sequence[Sequence[str]], caption: str = "") -> str:
    """An HTML table; all cells are escaped."""
    head = "".join(f"<th>{escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    title = f"<h2>{escape(caption)}</h2>" if caption else ""
    return f"{title}<table><tr>{head}</tr>{body}</table>"


def select(name: str, options: Any, **more: Any) -> pn.widgets.Select:
    """A list to choose from, with its label."""
    return pn.widgets.Select(name=name, options=options, **{"width": WIDTH, **NARROW, **more})


def entry(name: str, **more: Any) -> pn.widgets.TextInput:
    """A line to write into, with its label."""
    return pn.widgets.TextInput(name=name, **{"width": WIDTH, **NARROW, **more})


def button(name: str, **options: Any) -> pn.widgets.Button:
    """A button, as narrow as its words."""
    return pn.widgets.Button(name=name, **{"margin": (3, 3), "button_type": "default", **options})


def plot(title: str, width: int, height: int, tools: str = "pan,wheel_zoom,box_zoom,reset", **options: Any) -> Any:
    """An empty Bokeh figure in the studio's look."""
    # Ranges are set by `frame`: an empty plot has no range of its own.
    ranges = {"x_range": Range1d(0, 1), "y_range": Range1d(0, 1), **options}
    drawing = figure(title=title, width=width, height=height, tools=tools, toolbar_location="right", **ranges)
    drawing.toolbar.logo = None
    drawing.title.text_font_size = "12px"
    drawing.xaxis.axis_label_text_font_size = drawing.yaxis.axis_label_text_font_size = "11px"
    drawing.xaxis.axis_label_text_font_style = drawing.yaxis.axis_label_text_font_style = "normal"
    drawing.grid.grid_line_color = "#eceef0"
    drawing.min_border = 4
    return drawing


def frame(drawing: Any, x: tuple[float, float], y: tuple[float, float]) -> None:
    """The plot's ranges, now and after its reset."""
    for axis, (low, high) in ((drawing.x_range, x), (drawing.y_range, y)):
        axis.update(start=low, end=high, reset_start=low, reset_end=high)


def extent(values: Any, margin: float = 0.04) -> tuple[float, float]:
    """A range that holds all values, with a margin; (0, 1) where there are none."""
    if len(values) == 0:
        return 0.0, 1.0
    low, high = float(np.min(values)), float(np.max(values))
    space = margin * max(high - low, 1e-3)
    return low - space, high + space
