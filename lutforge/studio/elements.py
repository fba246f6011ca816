"""What pages are made of: controls by their labels, tables, and HTML in which all that comes from files is text."""

from collections.abc import Iterable
from html import escape
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.report.tables import Table

NOTHING = {"–": ""}
"""The options of a list from which nothing can be chosen yet."""
WIDE = {"sizing_mode": "stretch_width", "margin": (4, 8)}
TOGETHER = {"sizing_mode": "stretch_width", "margin": 0}
"""Layout of controls that stand together in a column."""
NARROW: dict[str, Any] = {"sizing_mode": "fixed", "width": 230}

TEXT = """
:host { font: 0.875rem/1.4 system-ui, sans-serif; color: var(--mui-palette-text-primary); }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: right; padding: 2px 8px; border-bottom: 1px solid var(--mui-palette-divider);
  font-variant-numeric: tabular-nums; }
th { font-weight: 600; } th:first-child, td:first-child { text-align: left; }
h2 { font-size: 0.9375rem; margin: 6px 0 2px; } p { margin: 3px 0; }
code { font-size: 0.8125rem; overflow-wrap: anywhere; white-space: pre-wrap; }
a { color: inherit; }
.pictures { display: flex; gap: 6px; background: #767676; height: 12rem; justify-content: center; }
.pictures img { flex: 1 1 0; min-width: 0; height: 100%; object-fit: contain; }
.out { opacity: 0.3; }
i.colour { display: inline-block; width: 0.9em; height: 0.9em; margin-right: 0.4em; vertical-align: -0.1em;
  outline: 1px solid var(--mui-palette-divider); }
"""


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
    return pn.pane.HTML(shown or "", stylesheets=[TEXT], **{**WIDE, **options})


def table(shown: Table) -> Html:
    """An HTML table; all cells are escaped."""
    head = "".join(html("<th scope='col'>{}</th>", cell or Html("&nbsp;")) for cell in shown.header)
    body = "".join("<tr>" + "".join(html("<td>{}</td>", cell) for cell in row) + "</tr>" for row in shown.rows)
    return html("<h2>{}</h2><table><tr>{}</tr>{}</table>", shown.caption, Html(head), Html(body))


def slider(label: str, value: float, start: float, end: float, step: float = 0.01, **more: Any) -> pmui.FloatSlider:
    """A slider that the keyboard moves, too."""
    made = pmui.FloatSlider(label=label, value=value, start=start, end=end, step=step, size="small", **{**WIDE, **more})
    made._priority_changes = ["value"]  # Panel's pause of 50 ms is what a picture would lag behind
    made._busy__ignore = ["value"]  # and the news that the server is busy
    return made


def limits(label: str, reach: tuple[float, float], step: float) -> pmui.RangeSlider:
    """A slider with two ends."""
    return pmui.RangeSlider(label=label, value=reach, start=reach[0], end=reach[1], step=step, size="small", **WIDE)


def select(label: str, options: Any, **more: Any) -> pmui.Select:
    """A list to choose from."""
    return pmui.Select(label=label, options=options, size="small", **{**WIDE, "margin": (8, 8), **more})


def entry(label: str, **more: Any) -> pmui.TextInput:
    """A line to write into."""
    return pmui.TextInput(label=label, size="small", **{**WIDE, "margin": (8, 8), **more})


def checkbox(label: str, value: bool = False) -> pmui.Checkbox:
    """A box to tick."""
    return pmui.Checkbox(label=label, value=value, **WIDE)


def written(line: pmui.TextInput) -> str:
    """What stands in a line, whether or not it was finished with the enter key."""
    return str(line.value_input or line.value or "").strip()


def offer(choice: pmui.Select, names: Iterable[str]) -> None:
    """Offer these names; what is chosen stays where it is one of them, else the first is chosen."""
    known = list(names)
    choice.options = known or NOTHING
    if choice.value not in known:
        choice.value = known[0] if known else ""


def ticks(label: str) -> pmui.CheckBoxGroup:
    """A list of which any can be ticked."""
    return pmui.CheckBoxGroup(label=label, options=[], **WIDE)


def sections(parts: dict[str, Any]) -> pmui.Accordion:
    """Controls by the titles of folds, closed at first."""
    return pmui.Accordion(*parts.items(), disable_gutters=True, **{**WIDE, "margin": (4, 4)})
