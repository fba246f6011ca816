"""`lutforge kit`: a profile → a folder that makes one program show the camera's look."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, note, option, print_tables, progress_bar, say
from lutforge.report.tables import Table


def kit(
    profile: Profile,
    to: Annotated[str, option("The look: STYLE/WB.", "--to")],
    output: Annotated[Path, option("The folder to write.", "-o", "--output")] = Path("kit"),
    program: Annotated[
        str | None,
        option(
            "darktable, rawtherapee, art, lightroom, resolve, nuke, blender, ffmpeg, obs, gimp or lumix; "
            "unless given, the one that developed the profile's pictures; of camera RAW "
            "rawtherapee.",
            "--for",
        ),
    ] = None,
    check: Annotated[
        list[Path] | None,
        option("RAW files that the profile is not from, to develop with the kit and compare.", "--check"),
    ] = None,
) -> None:
    """Write a kit: LUT or camera profile, the preset that places it, and a page that says what to do."""
    from lutforge.model.camera_profile import load_profile
    from lutforge.pipeline.kits import check_kit, write_kit

    with progress_bar("writing a kit") as progress:
        progress(program or "", 0.0)
        folder = write_kit(load_profile(profile), to, output, program)
    say(f"{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first")
    if not check:
        return
    with progress_bar("developing") as progress:
        checks, notes = check_kit(folder, check, progress)
    note(*notes)
    rows = [
        (entry.shot, str(entry.tiles), f"{entry.mean:.2f}", f"{entry.p95:.2f}", f"{entry.maximum:.2f}")
        for entry in checks
    ]
    header = ("shot", "tiles", "mean", "95 %", "max")
    print_tables(Table("What the program shows against the camera's JPEG, ΔE00", header, rows))
