"""`lutforge inspect`, `check`: what a file is and can be used for; what is in a LUT file, and who can read it."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import argument, for_each, note, option, print_tables, progress_bar, say
from lutforge.report.tables import Table, held_out_table


def inspect(
    files: Annotated[list[Path], argument("RAW files, pictures, sample tables, profiles, LUTs, and folders of them.")],
    scene: Annotated[
        Path | None,
        option(
            "Compare shots with a profile's rendering: what the camera did beyond it, in stops.",
            "--scene",
            metavar="PROFILE",
        ),
    ] = None,
) -> None:
    """Show what files are: a shot's or picture's camera and settings, what a profile, table or LUT holds."""
    from lutforge.pipeline.inspection import files_to_inspect
    from lutforge.pipeline.inspection import inspect as look

    if scene is not None:
        from lutforge.pipeline.evaluation import inspect_scene

        with progress_bar("sampling") as progress:
            table, notes = inspect_scene(scene, files, progress)
        print_tables(table)
        note(*notes)
        return

    def show(file: Path) -> None:
        content = look(file)
        if content.lines:
            say(*content.lines)
            return
        print_tables(Table(str(file), ("", ""), content.rows))
        if content.profile is not None:
            print_tables(held_out_table(content.profile))

    for_each("inspecting", [file for path in files for file in files_to_inspect(path)], show)


def check(luts: Annotated[list[Path], argument("LUT files of any origin.")]) -> None:
    """Show what LUT files hold, which programs read them, and which misread them."""
    from lutforge.pipeline.inspection import check as lines_of

    for_each("checking", luts, lambda path: say(*lines_of(path)))
