"""What all commands share: arguments, progress bars on stderr, tables and notes.

Rich draws bars and tables, and is loaded where one is drawn.
"""

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from lutforge.errors import LutForgeError
from lutforge.report.tables import Table


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
        TextColumn("[bold]{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
        TextColumn("{task.fields[what]}"),
    )
    bar = Progress(*columns, console=Console(stderr=True), transient=True, redirect_stdout=sys.stdout.isatty())
    with bar as bars:
        task = bars.add_task(title, total=1.0, what="")

        def progress(what: str, share: float) -> None:
            bars.update(task, completed=share, what=escape(what[:60]))

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


def say(text: str) -> None:
    """One line on stdout, as it is."""
    print(text)


def note(text: str) -> None:
    """One line on stderr that is not an error."""
    dim, plain = ("\x1b[2m", "\x1b[0m") if sys.stderr.isatty() and os.name == "posix" else ("", "")
    print(f"{dim}note:{plain} {text}", file=sys.stderr)


def complain(text: str) -> None:
    """One line on stderr about what failed, where other things go on."""
    print(f"lutforge: {text}", file=sys.stderr)


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


def print_table(table: Table) -> None:
    """A table on stdout, if it has rows; columns of numbers are set right."""
    if not table.rows:
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table as Lines

    # Tables are as wide as they need: a narrow terminal wraps whole lines, not letters.
    width = max(Console().width, 140) if sys.stdout.isatty() else 240
    lines = Lines(
        title=table.caption, title_justify="left", title_style="bold", header_style="bold", box=None, pad_edge=False
    )
    for name, numeric in zip(table.header, table.numeric, strict=True):
        lines.add_column(name, justify="right" if numeric else "left", overflow="fold", no_wrap=numeric)
    for row in table.rows:
        lines.add_row(*map(escape, row))
    Console(highlight=False, width=width, soft_wrap=True).print(lines)


Profile = Annotated[Path, typer.Argument(help="The profile (.npz).", show_default=False)]
Shots = Annotated[list[Path], typer.Argument(help="RAW files, or folders of them.", show_default=False)]
Sources = Annotated[
    list[Path],
    typer.Argument(help="Sample tables (.csv, .parquet), RAW files, folders of RAW files.", show_default=False),
]
ProfileOutput = Annotated[Path, typer.Option("-o", "--output", help="The profile to write (.npz).")]
AsJson = Annotated[bool, typer.Option("--json", help="Print everything as JSON, for programs.")]
DeveloperName = Annotated[
    str | None,
    typer.Option(help="Instead of RAW, what this program feeds to a LUT: darktable or rawtherapee."),
]
DevelopedFolder = Annotated[
    Path | None, typer.Option(help="A folder of pictures that another program developed, one a shot, same stem.")
]
DevelopedSpace = Annotated[
    str | None, typer.Option("--developed-space", help="The colour space of those pictures, such as prophoto.")
]
