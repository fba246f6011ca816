"""What all commands share: progress bars on stderr, tables and notes."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import typer
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from lutforge.errors import LutForgeError

out = Console(highlight=False, soft_wrap=True)
_TABLES = Console(highlight=False, width=max(out.width, 140) if out.is_terminal else 240, soft_wrap=True)
"""Tables are as wide as they need: a narrow terminal wraps whole lines, not letters."""
err = Console(stderr=True, highlight=False, soft_wrap=True)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar on stderr while the block runs, where stderr is a terminal; yields report(what, share)."""
    columns = (
        TextColumn("[bold]{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[what]}"),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bars:
        task = bars.add_task(title, total=1.0, what="")

        def report(what: str, share: float) -> None:
            bars.update(task, completed=share, what=escape(what[:60]))

        yield report


@contextmanager
def quiet_codecs() -> Iterator[None]:
    """Keep what image libraries print by themselves, such as libpng, off stderr: the errors say it in one line."""
    sys.stderr.flush()
    python_stderr, stderr = sys.stderr, os.dup(2)
    with Path(os.devnull).open("w") as nowhere, os.fdopen(os.dup(stderr), "w", buffering=1) as sys.stderr:
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            sys.stderr = python_stderr


def say(text: str) -> None:
    """One line on stdout, as it is."""
    out.print(escape(text))


def note(text: str) -> None:
    """One line on stderr that is not an error."""
    err.print(f"[dim]note:[/dim] {escape(text)}")


def for_each(files: Sequence[Path], show: Callable[[Path], None]) -> None:
    """Show each file; one that cannot be is an error line, and the others are shown. Exits 2 where there was one."""
    failed = False
    for file in files:
        try:
            show(file)
        except LutForgeError as error:
            if len(files) == 1:
                raise
            failed = True
            err.print(f"lutforge: {error}", markup=False)
    if failed:
        raise typer.Exit(2)


def print_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """A table on stdout; columns after the first are set right where they hold numbers."""
    table = Table(title=title, title_justify="left", title_style="bold", header_style="bold", box=None, pad_edge=False)
    for index, name in enumerate(header):
        cells = [row[index] for row in rows]
        numeric = bool(cells) and all(not cell or cell == "–" or cell[0].isdigit() for cell in cells)
        table.add_column(name, justify="right" if numeric else "left", overflow="fold", no_wrap=numeric)
    for row in rows:
        table.add_row(*(escape(cell) for cell in row))
    _TABLES.print(table)
