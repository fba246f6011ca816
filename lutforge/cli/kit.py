"""The command that writes kits, by which other programs show a camera's look, and installs and checks them."""

from pathlib import Path
from typing import Annotated

import lutforge as lf
from lutforge.cli.console import argument, note, option, print_tables, progress_bar, say
from lutforge.cli.program_names import KIT_PROGRAMS
from lutforge.errors import SettingsError
from lutforge.reports.tables import Table


def kit(
    profile: Annotated[Path | None, argument("A profile (.npz); not for --uninstall.")] = None,
    to: Annotated[str | None, option("The look: STYLE or STYLE/WB; all for every style.", "--to")] = None,
    further_shots: Annotated[list[Path] | None, argument("Further RAW files of --check.", metavar="[SHOT]...")] = None,
    output: Annotated[
        Path | None,
        option("The folder to write; by default named by profile and program: camera_darktable_kit.", "-o", "--output"),
    ] = None,
    program: Annotated[
        str,
        option(
            f"The program that will show the look: {', '.join(KIT_PROGRAMS)}.",
            "--for",
        ),
    ] = "rawtherapee",
    base: Annotated[str | None, option("For lumix: the camera's style that the LUT lies on; else V-Log.")] = None,
    look: Annotated[Path | None, option("With --base: another camera's profile, which has the look.", "--as")] = None,
    check: Annotated[
        list[Path] | None,
        option("RAW files, better such that the profile is not from, to develop with the kit and compare.", "--check"),
    ] = None,
    install: Annotated[bool, option("Put its files where the program looks for them.", "--install")] = False,
    into: Annotated[Path | None, option("With --install: the program's folder of settings, if not the usual.")] = None,
    uninstall: Annotated[bool, option("Take away what --install put there.", "--uninstall")] = False,
) -> None:
    """Write a kit: camera profile or LUT, the preset that places it, and a page that says what to do."""
    if install and uninstall:
        raise SettingsError("--install and --uninstall exclude each other")
    if into is not None and not install:
        raise SettingsError("--into goes with --install")
    if uninstall:
        _uninstall(program)
        return
    if profile is None or to is None:
        raise SettingsError("a kit needs a profile and a look: lutforge kit camera.npz --to STYLE --for PROGRAM -o kit")
    if further_shots and not check:
        raise SettingsError(f"{further_shots[0]}: shots go with --check")

    # Named by profile and program, so that a kit for a second program, or of a second camera, replaces no other.
    output = output or Path(f"{profile.stem}_{program.lower()}_kit")
    with progress_bar("writing a kit") as progress:
        folder = lf.write_kit(profile, to, output, program, base=base, look=look, progress=progress)
    _print_contents(folder)
    if install:
        _install(folder, into)
    if check:
        _check(folder, [*check, *(further_shots or [])])


def _print_contents(folder: Path) -> None:
    """Print the files of a kit, and their errors."""
    from lutforge.pipeline.kits import kit_contents

    files, *errors = kit_contents(folder)
    say(f"{folder}: {files}", *errors)


def _check(folder: Path, shots: list[Path]) -> None:
    """Develop shots with a kit, and print how far the pictures are from the camera's own."""
    from lutforge.pipeline.kit_checks import check_kit

    with progress_bar("developing") as progress:
        checks, notes = check_kit(folder, shots, progress)
    note(*notes)
    rows = []
    for result in checks:
        figures = (f"{value:.2f}" for value in (result.mean, result.p95, result.maximum))
        rows.append((result.shot, str(result.tiles), *figures, "yes" if result.calibrated else "no"))
    header = ("shot", "tiles", "mean", "95 %", "max", "calibrated from")
    print_tables(Table("What the program shows against the camera's JPEG, ΔE00", header, rows))
    if any(result.calibrated for result in checks):
        note("shots that the profile was calibrated from flatter it: check others, too")


def _install(folder: Path, into: Path | None) -> None:
    """Copy a kit to where its program looks for it, and print each file."""
    from lutforge.pipeline.kit_installation import install_kit

    installation = install_kit(folder, into)
    program = installation.program
    files = installation.files
    if installation.found:
        say(*(f"installed: {file}" for file in files))
        note(f"{program}: {installation.use}")
    elif files:
        note(f"{program} is not on this machine, so nothing was installed. Its files go to:", *map(str, files))
    else:
        note(f"no folder of {program} is known on this system; the README of {folder} says what to do")


def _uninstall(program: str) -> None:
    """Remove the files installed for a program, and print each file."""
    from lutforge.pipeline.kit_installation import uninstall_kit

    removed, changed = uninstall_kit(program)
    say(*(f"removed: {file}" for file in removed))
    note(*(f"{file}: changed since it was installed; it stays" for file in changed))
