"""A report as blocks of text, tables and pictures, and how it becomes one HTML file that needs nothing else."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure

from lutforge.atomic_write import atomic_path
from lutforge.progress import Progress, silent
from lutforge.report.drawing import Drawing
from lutforge.report.matplotlib_figure import figure_of, save_png, to_svg
from lutforge.report.tables import Table


@dataclass(frozen=True, eq=False)
class Picture:
    """A figure; name: of its files, where the figures are written apart."""

    name: str
    drawing: Drawing
    caption: str

    @cached_property
    def figure(self) -> Figure:
        """The figure as matplotlib draws it."""
        return figure_of(self.drawing)

    @cached_property
    def svg(self) -> str:
        """The figure as an <svg> element, whose ids are its own within a page."""
        prefix = re.sub(r"\W", "_", self.name)
        return re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{prefix}_", to_svg(self.figure))


Block = str | tuple[str, ...] | Picture | Table
"""A paragraph, sentences one below the other, a figure, a table."""


@dataclass(frozen=True, eq=False)
class Section:
    """A heading and what stands below it."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True, eq=False)
class Report:
    """A page: its title, the line below it, what it says in short, its sections, and answers that come before them."""

    title: str
    subtitle: str
    lead: tuple[str, ...] = ()
    sections: tuple[Section, ...] = ()
    answers: tuple[Section, ...] = ()

    @property
    def pictures(self) -> Sequence[Picture]:
        """All figures in order."""
        return [block for section in self.sections for block in section.blocks if isinstance(block, Picture)]


def write_page(report: Report, path: str | Path, progress: Progress = silent) -> None:
    """One self-contained HTML file: no script, nothing from a network; names are escaped."""
    from lutforge import __version__

    environment = Environment(
        loader=PackageLoader("lutforge.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    for index, picture in enumerate(report.pictures):
        progress(f"drawing {picture.name}", index / len(report.pictures))
        _ = picture.svg
    html = environment.get_template("report.html").render(report=report, version=__version__)
    with atomic_path(path) as temporary:
        temporary.write_text(html, encoding="utf-8")


def write_figures(report: Report, folder: str | Path) -> list[Path]:
    """Every figure as SVG and PNG."""
    written = []
    for picture in report.pictures:
        vector, pixels = (Path(folder) / f"{picture.name}{suffix}" for suffix in (".svg", ".png"))
        with atomic_path(vector) as temporary:
            temporary.write_text(to_svg(picture.figure), encoding="utf-8")
        save_png(picture.figure, pixels, dpi=150)
        written += [vector, pixels]
    return written
