"""Pages: blocks of text, tables and figures under headings, written as one HTML file without links to others."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from lutforge import __version__
from lutforge.atomic_write import atomic_path
from lutforge.progress import Progress, silent
from lutforge.reports.drawing import Drawing
from lutforge.reports.matplotlib_figure import figure_of, to_svg
from lutforge.reports.tables import Table


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure with its caption. name: unique within a page."""

    name: str
    drawing: Drawing
    caption: str

    @cached_property
    def figure(self) -> Figure:
        """The figure as matplotlib draws it."""
        return figure_of(self.drawing)

    @cached_property
    def svg(self) -> str:
        """The figure as an <svg> element, whose ids are unique within a page."""
        prefix = re.sub(r"\W", "_", self.name)
        return re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{prefix}_", to_svg(self.figure))


Block = str | tuple[str, ...] | Picture | Table
"""A block of a page: a paragraph, a list of sentences, a figure, or a table."""

Sections = Mapping[str, tuple[Block, ...]]
"""Blocks by heading."""


@dataclass(frozen=True, eq=False)
class Report:
    """A page: title, subtitle, summary (lead), the answers, and the sections after them."""

    title: str
    subtitle: str
    lead: tuple[str, ...] = ()
    sections: Sections = field(default_factory=dict)
    answers: Sections = field(default_factory=dict)

    @property
    def pictures(self) -> Sequence[Picture]:
        """All figures in order."""
        blocks = (block for part in (self.answers, self.sections) for blocks in part.values() for block in blocks)
        return [block for block in blocks if isinstance(block, Picture)]


def write_page(report: Report, path: str | Path, progress: Progress = silent) -> None:
    """Write a report as one HTML file, without scripts or links to a network; names are escaped."""
    loader = PackageLoader("lutforge.reports")
    jinja = Environment(loader=loader, autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    for index, picture in enumerate(report.pictures):
        progress(f"drawing {picture.name}", index / len(report.pictures))
        _ = picture.svg
    html = jinja.get_template("report.html").render(report=report, version=__version__)
    with atomic_path(path) as temporary:
        temporary.write_text(html, encoding="utf-8")
