"""What all commands share: arguments, progress bars on stderr, tables and notes."""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any
from unicodedata import combining, east_asian_width

import typer

from lutforge.errors import LutForgeError
from lutforge.reports.tables import Table


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[str, float], None]]:
    """A bar on stderr while the block runs, where stderr is a terminal; yields report(what, share)."""
    if not sys.stderr.isatty():
        yield lambda what, share: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("[bold]{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[what]}"),
    )  # fmt: skip
    bar = Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=sys.stdout.isatty())
    with bar as bars:
        task = bars.add_task(title, total=1.0, what="")

        def progress(what: str, share: float) -> None:
            bars.update(task, completed=share, what=escape(harmless(what[:60])))

        yield progress


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


def harmless(text: str) -> str:
    """The text with control characters, which a terminal would obey, as "?": it may quote a file of unknown origin."""
    return text.translate(dict.fromkeys((*range(32), *range(127, 160)), "?"))


def say(*lines: str) -> None:
    """Lines on stdout."""
    for line in lines:
        print(harmless(line))


def note(*lines: str) -> None:
    """Lines on stderr that are no errors."""
    dim, plain = ("\x1b[2m", "\x1b[0m") if sys.stderr.isatty() and os.name == "posix" else ("", "")
    for line in lines:
        print(f"{dim}note:{plain} {harmless(line)}", file=sys.stderr)


def complain(text: str) -> None:
    """One line on stderr about what failed, where other things go on."""
    print(f"lutforge: {harmless(text)}", file=sys.stderr)


def for_each(title: str, files: Sequence[Path], show: Callable[[Path], None]) -> None:
    """Show each file. One that fails becomes an error line, the others are shown, and the exit status is 2."""
    failed = False
    with progress_bar(title) as progress:
        for index, file in enumerate(files):
            progress(file.name, index / len(files))
            try:
                show(file)
            except LutForgeError as error:
                if len(files) == 1:
                    raise
                failed = True
                complain(str(error))
    if failed:
        raise typer.Exit(2)


def print_tables(*tables: Table) -> None:
    """Tables on stdout, those that have rows; columns of numbers are set right. A narrow terminal wraps whole lines."""
    bold, plain = ("\x1b[1m", "\x1b[0m") if sys.stdout.isatty() and os.name == "posix" else ("", "")
    for table in (table for table in tables if table.rows):
        lines = [[harmless(cell) for cell in row] for row in (table.header, *table.rows)]
        widths = [max(map(_columns, column)) for column in zip(*lines, strict=True)]
        if table.caption:
            print(f"{bold}{harmless(table.caption)}{plain}")
        for row, line in enumerate(lines):
            cells = []
            for cell, width, numeric in zip(line, widths, table.numeric, strict=True):
                gap = " " * (width - _columns(cell))
                cells.append(gap + cell if numeric else cell + gap)
            if text := "  ".join(cells).rstrip():
                print(text if row else f"{bold}{text}{plain}")


def _columns(text: str) -> int:
    """How wide a terminal shows the text: ideographs take two columns, combining marks none."""
    return len(text) if text.isascii() else sum(1 + (east_asian_width(c) in "WF") - (combining(c) > 0) for c in text)


def argument(help: str, **more: Any) -> Any:
    """What a command is given, in words for its help."""
    return typer.Argument(help=help, **{"show_default": False, **more})


def option(help: str, *names: str, **more: Any) -> Any:
    """An option of a command, in words for its help, and its names where the parameter's is not enough."""
    return typer.Option(*names, help=help, **more)


Profile = Annotated[Path, argument("The profile (.npz).")]
