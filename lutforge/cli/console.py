"""The console of all commands: arguments, progress bars on stderr, tables and notes."""

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
    """A progress bar on stderr while the block runs, where stderr is a terminal; yields its `Progress` callback."""
    if not sys.stderr.isatty():
        yield lambda step, share: None
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    columns = (
        TextColumn("[bold]{task.description}"), BarColumn(), TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(), TimeRemainingColumn(), TextColumn("{task.fields[step]}"),
    )  # fmt: skip
    bar = Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=sys.stdout.isatty())
    with bar as bars:
        task = bars.add_task(title, total=1.0, step="")

        def progress(step: str, share: float) -> None:
            bars.update(task, completed=share, step=escape(harmless(step[:60])))

        yield progress


@contextmanager
def quiet_codecs() -> Iterator[None]:
    """Discard text that image libraries such as libpng print on stderr: LutForge's errors report it in one line."""
    sys.stderr.flush()
    python_stderr = sys.stderr
    stderr = os.dup(2)
    with Path(os.devnull).open("w") as nowhere, os.fdopen(os.dup(stderr), "w", buffering=1) as sys.stderr:
        os.dup2(nowhere.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(stderr, 2)
            os.close(stderr)
            sys.stderr = python_stderr


def harmless(text: str) -> str:
    """The text with "?" for control characters, which a terminal would obey: it may quote an untrusted file."""
    return text.translate(dict.fromkeys((*range(32), *range(127, 160)), "?"))


def say(*lines: str) -> None:
    """Print lines on stdout."""
    for line in lines:
        print(harmless(line))


def note(*lines: str) -> None:
    """Print notes on stderr."""
    dim, plain = ("\x1b[2m", "\x1b[0m") if sys.stderr.isatty() and os.name == "posix" else ("", "")
    for line in lines:
        print(f"{dim}note:{plain} {harmless(line)}", file=sys.stderr)


def complain(text: str) -> None:
    """Print the error of one file on stderr, in one line, where the command continues with others."""
    print(f"lutforge: {harmless(text)}", file=sys.stderr)


def for_each(title: str, files: Sequence[Path], show: Callable[[Path], None]) -> None:
    """Show each file. For one that fails an error is printed, the others are shown, and the exit status is 2."""
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
    """Print the tables that have rows; columns of numbers are aligned right. A narrow terminal wraps whole lines."""
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
    """The width of a text on a terminal, in columns: an ideograph has two, a combining mark none."""
    return len(text) if text.isascii() else sum(1 + (east_asian_width(c) in "WF") - (combining(c) > 0) for c in text)


def argument(help: str, **settings: Any) -> Any:
    """A positional argument of a command. help: its text in the help; settings: of typer."""
    return typer.Argument(help=help, **{"show_default": False, **settings})


def option(help: str, *names: str, **settings: Any) -> Any:
    """An option of a command. help: its text in the help; names: where not the parameter's; settings: of typer."""
    return typer.Option(*names, help=help, **settings)


Profile = Annotated[Path, argument("The profile (.npz).")]
ProfileOutput = Annotated[
    Path | None, option("The profile to write (.npz).", "-o", "--output", show_default="camera.npz, if it is new")
]
