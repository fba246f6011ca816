"""What pages are made of: controls by their labels, tables, text that is only text, plots that can be saved."""

from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.models import CustomAction, CustomJS, Range1d
from bokeh.plotting import figure

from lutforge.report.tables import Table

NOTHING = {"–": ""}
"""The options of a list from which nothing can be chosen yet."""
LINE = "#8c8c8c"
"""A grey that stands out from the plots of both themes."""
CHANNELS = (("Red", "#e0503c", "solid"), ("Green", "#2f9e63", "dashed"), ("Blue", "#4f83e0", "dotted"))
"""Name, colour and line style of each channel: the style tells them apart where the colours do not."""
FILL = {"sizing_mode": "stretch_both", "margin": 0}
WIDE = {"sizing_mode": "stretch_width", "margin": (4, 8)}
TOGETHER = {"sizing_mode": "stretch_width", "margin": 0}
"""Layout of controls that stand together in a column."""

TEXT = """
:host { font: 0.875rem/1.4 system-ui, sans-serif; color: var(--mui-palette-text-primary); }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: 2px 8px; border-bottom: 1px solid var(--mui-palette-divider);
  font-variant-numeric: tabular-nums; }
th { font-weight: 600; } th:first-child, td:first-child { text-align: left; }
h2 { font-size: 0.9375rem; margin: 6px 0 2px; } p { margin: 3px 0; }
code { font-size: 0.8125rem; overflow-wrap: anywhere; }
a { color: inherit; }
"""


def text(html: str = "", **options: Any) -> pn.pane.HTML:
    """A pane of HTML that is made here; whatever comes from files goes through `escape`."""
    return pn.pane.HTML(html, stylesheets=[TEXT], **{**WIDE, **options})


def table(shown: Table) -> str:
    """An HTML table; all cells are escaped."""
    head = "".join(f"<th scope='col'>{escape(cell) or '&nbsp;'}</th>" for cell in shown.header)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in shown.rows)
    return f"<h2>{escape(shown.caption)}</h2><table><tr>{head}</tr>{body}</table>"


def slider(label: str, value: float, start: float, end: float, step: float = 0.01, **more: Any) -> pmui.FloatSlider:
    """A slider that the keyboard moves, too."""
    made = pmui.FloatSlider(label=label, value=value, start=start, end=end, step=step, size="small", **{**WIDE, **more})
    made._priority_changes = ["value"]  # Panel's pause of 50 ms is what a picture would lag behind
    made._busy__ignore = ["value"]  # and the news that the server is busy
    return made


def select(label: str, options: Any, **more: Any) -> pmui.Select:
    """A list to choose from."""
    return pmui.Select(label=label, options=options, size="small", **{**WIDE, "margin": (8, 8), **more})


def entry(label: str, **more: Any) -> pmui.TextInput:
    """A line to write into."""
    return pmui.TextInput(label=label, size="small", **{**WIDE, "margin": (8, 8), **more})


def written(line: pmui.TextInput) -> str:
    """What stands in a line, whether or not it was finished with the enter key."""
    return str(line.value_input or line.value or "").strip()


def offer(choice: pmui.Select, names: Iterable[str]) -> None:
    """Offer these names; what is chosen stays where it is one of them, else the first is chosen."""
    known = list(names)
    choice.options = known or NOTHING
    if choice.value not in known:
        choice.value = known[0] if known else ""


def ticks(label: str, options: Any = None, **more: Any) -> pmui.CheckBoxGroup:
    """A list of which any can be ticked."""
    return pmui.CheckBoxGroup(label=label, options=options or [], **{**WIDE, **more})


def sections(**parts: Any) -> pmui.Accordion:
    """Controls by the titles of folds, closed at first."""
    named = [(title.replace("_", " "), part) for title, part in parts.items()]
    return pmui.Accordion(*named, disable_gutters=True, **{**WIDE, "margin": (4, 4)})


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
    # Ranges are set by `frame`: an empty plot has no range of its own.
    ranges = {"x_range": Range1d(0, 1), "y_range": Range1d(0, 1), **options}
    drawing = figure(
        title=title, tools=tools, toolbar_location="right", sizing_mode="stretch_both", min_width=160, min_height=140,
        min_border=4, **ranges,
    )  # fmt: skip
    drawing.toolbar.logo = None
    svg = CustomJS(args={"drawing": drawing}, code=_SAVE_SVG)
    drawing.add_tools(CustomAction(description="Save as SVG", icon="text_align_left", callback=svg))
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
