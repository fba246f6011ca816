"""The commands that show what files are, and what LUT files hold: inspect and check."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import argument, for_each, note, option, print_tables, progress_bar, say
from lutforge.reports.tables import Table, held_out_table


def inspect(
    files: Annotated[list[Path], argument("RAW files, pictures, sample tables, profiles, LUTs, and folders of them.")],
    scene: Annotated[
        Path | None,
        option("Compare shots with a profile's rendering: what the camera did beyond it, in stops.", metavar="PROFILE"),
    ] = None,
) -> None:
    """Show the contents of files: camera and settings of shots and pictures; profiles, tables and LUTs."""
    from lutforge.pipeline import inspection

    if scene is not None:
        from lutforge.pipeline.evaluation import inspect_scene

        with progress_bar("sampling") as progress:
            table, notes = inspect_scene(scene, files, progress)
        print_tables(table)
        note(*notes)
        return

    def show(file: Path) -> None:
        content = inspection.inspect(file)
        say(*content.lines)
        if content.rows:
            print_tables(Table(str(file), ("", ""), content.rows))
        if content.profile is not None:
            print_tables(held_out_table(content.profile))

    for_each("inspecting", [file for path in files for file in inspection.files_to_inspect(path)], show)


def check(luts: Annotated[list[Path], argument("LUT files of any origin.")]) -> None:
    """Show what LUT files hold, which programs read them, and which misread them."""
    from lutforge.pipeline import inspection

    for_each("checking", luts, lambda path: say(*inspection.check(path)))
