"""`lutforge inspect`: what a file is, and what it can be used for."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import for_each, note, print_table, progress_bar
from lutforge.report.tables import Table, held_out_table


def inspect(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="RAW files, pictures, sample tables, profiles, LUTs, and folders of them.", show_default=False
        ),
    ],
    scene: Annotated[
        Path | None,
        typer.Option(
            "--scene",
            metavar="PROFILE",
            help="Compare shots with a profile's rendering: what the camera did beyond it, in stops.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Show what files are: a shot's or picture's camera and settings, what a profile, table or LUT holds."""
    from lutforge.pipeline.inspection import files_to_inspect

    if scene is not None:
        from lutforge.pipeline.scene import inspect_scene

        with progress_bar("sampling") as progress:
            found = inspect_scene(scene, files, progress)
        print_table(found.table)
        for text in found.notes:
            note(text)
        return
    for_each("inspecting", [file for path in files for file in files_to_inspect(path)], _show)


def _show(file: Path) -> None:
    from lutforge.pipeline.inspection import inspect as look

    found = look(file)
    print_table(Table(str(file), ("", ""), found.rows))
    if found.profile is not None:
        print_table(held_out_table(found.profile))
