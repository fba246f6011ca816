"""`lutforge inspect`: what a file is, and what it can be used for."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.calibrate import print_held_out
from lutforge.cli.console import for_each, print_table


def inspect(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="RAW files, pictures, sample tables, profiles, LUTs, and folders of them.", show_default=False
        ),
    ],
) -> None:
    """Show what files are: a shot's or picture's camera and settings, what a profile, table or LUT holds."""
    from lutforge.pipeline.inspection import files_to_inspect

    for_each([file for path in files for file in files_to_inspect(path)], _show)


def _show(file: Path) -> None:
    from lutforge.pipeline.inspection import inspect as look

    found = look(file)
    print_table(str(file), ("", ""), found.rows)
    if found.profile is not None:
        print_held_out(found.profile)
