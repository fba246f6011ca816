"""`lutforge kit`: a profile → a folder that makes one program show the camera's look."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, argument, note, option, print_tables, progress_bar, say
from lutforge.errors import SettingsError
from lutforge.report.tables import Table


def kit(
    profile: Profile,
    to: Annotated[str, option("The look: STYLE or STYLE/WB; all for every style.", "--to")],
    more: Annotated[list[Path] | None, argument("Further RAW files of --check.", metavar="[SHOT]...")] = None,
    output: Annotated[Path, option("The folder to write.", "-o", "--output")] = Path("kit"),
    program: Annotated[
        str,
        option(
            "darktable, rawtherapee, art, lightroom, captureone, digikam, rapidraw, resolve, nuke, blender, ffmpeg, "
            "obs, gimp or lumix.",
            "--for",
        ),
    ] = "rawtherapee",
    base: Annotated[str | None, option("For lumix: the camera's style that the LUT lies on; else V-Log.")] = None,
    look: Annotated[Path | None, option("With --base: another camera's profile, which has the look.", "--as")] = None,
    check: Annotated[
        list[Path] | None,
        option("RAW files, better such that the profile is not from, to develop with the kit and compare.", "--check"),
    ] = None,
) -> None:
    """Write a kit: camera profile or LUT, the preset that places it, and a page that says what to do."""
    from lutforge.pipeline.kits import check_kit, write_kit

    if more and not check:
        raise SettingsError(f"{more[0]}: shots go with --check")
    with progress_bar("writing a kit") as progress:
        folder = write_kit(profile, to, output, program, base=base, look=look, progress=progress)
    say(f"{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first")
    if not check:
        return
    with progress_bar("developing") as progress:
        checks, notes = check_kit(folder, [*check, *(more or [])], progress)
    note(*notes)
    rows = []
    for each in checks:
        figures = (f"{value:.2f}" for value in (each.mean, each.p95, each.maximum))
        rows.append((each.shot, str(each.tiles), *figures, "yes" if each.calibrated else "no"))
    header = ("shot", "tiles", "mean", "95 %", "max", "calibrated from")
    print_tables(Table("What the program shows against the camera's JPEG, ΔE00", header, rows))
    if any(each.calibrated for each in checks):
        note("shots that the profile was calibrated from flatter it: check others, too")
