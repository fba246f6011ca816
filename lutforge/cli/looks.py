"""The commands that use profiles: LUTs, kits, configs and graded pictures; each imports its use case when it runs."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import lutforge as lf
from lutforge.cli.console import (
    Profile,
    argument,
    complain,
    note,
    option,
    print_tables,
    progress_bar,
    quiet_codecs,
    say,
)
from lutforge.errors import SettingsError, in_common
from lutforge.reports.tables import Table

if TYPE_CHECKING:
    from lutforge.pipeline.grading import Grading


PROGRAM_NAMES = (
    "resolve, nuke, ocio, oiio, baselight, flame, blender, photoshop, lightroom, premiere, aftereffects, finalcut, "
    "ffmpeg, mpv, mlt, kdenlive, shotcut, obs, darktable, rawtherapee, art, captureone, gmic, gimp, imagemagick, "
    "graphicsmagick, pillow, three, parse-cube-lut"
)
"""The choices of `--for`: the programs of `lutforge.luts.lut_programs`, repeated since importing it takes a second."""


def bake(
    profile: Profile,
    kind: Annotated[str, argument("render, linearize, refinish or match.")],
    other: Annotated[Path | None, argument("For match: the profile whose look is wanted.")] = None,
    output: Annotated[
        list[Path] | None, option("A LUT file; may repeat. The suffix picks the format.", "-o", "--output")
    ] = None,
    source: Annotated[str | None, option("STYLE/WB of the JPEG that comes in.", "--from")] = None,
    target: Annotated[
        str | None, option("STYLE/WB of the JPEG that comes out; of .icc and .dcp STYLE.", "--to")
    ] = None,
    ev: Annotated[float, option("Exposure change in stops (refinish, match; render from scene-linear light).")] = 0.0,
    space: Annotated[
        str,
        option(
            "What render takes and linearize gives: raw, or a colour space, linear (acescg, linear-rec2020 …) or "
            "encoded (vlog, slog3, logc4, acescct, davinci-intermediate …)."
        ),
    ] = "raw",
    reader: Annotated[
        str | None,
        option(
            f"The program that will read it, which without -o names the files: {PROGRAM_NAMES}.",
            "--for",
            autocompletion=lambda: PROGRAM_NAMES.split(", "),
        ),
    ] = None,
    size: Annotated[int | None, option("Nodes per axis of the cube.")] = None,
    tolerance: Annotated[float | None, option("Instead of a size: the ΔE00 that 99 % of colours keep within.")] = None,
    interpolation: Annotated[str | None, option("trilinear or tetrahedral: how the reader interpolates.")] = None,
    model: Annotated[str | None, option("lattice or model, where the profile holds both.")] = None,
    transfer: Annotated[Path | None, option("For match: RAW to RAW, from `lutforge transfer`.")] = None,
    colours: Annotated[
        bool, option(".icc: without the camera's tone curve, scene-linear, for one's own tone mapper.", "--colours")
    ] = False,
    clf_version: Annotated[
        str | None, option(".clf: 3 for readers that know the Academy's namespace alone, not SMPTE's.")
    ] = None,
) -> None:
    """Bake RAW → JPEG (render), JPEG → scene (linearize), JPEG → JPEG (refinish), or camera → camera (match)."""
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.transforms import TransformRequest

    request = TransformRequest(kind, source, target, ev, space, model, other, transfer)
    with progress_bar("baking") as progress:
        files, notes = bake_files(
            profile, request, output or (), program=reader, size=size, tolerance=tolerance, interpolation=interpolation,
            colours=colours, clf_version=clf_version, progress=progress,
        )  # fmt: skip
    for file in files:
        say(*str(file).splitlines())
    note(*notes)


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
            "darktable, rawtherapee, art, lightroom, captureone, resolve, nuke, blender, ffmpeg, gimp, obs or lumix.",
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
    from lutforge.kits.manifest import kit_errors
    from lutforge.pipeline.kit_checks import check_kit

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
    if output is None:  # so that a kit for a second program, or of a second camera, replaces no other
        output = Path(f"{profile.stem}_{program.lower()}_kit")
    with progress_bar("writing a kit") as progress:
        folder = lf.write_kit(profile, to, output, program, base=base, look=look, progress=progress)
    say(f"{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}; read README.md first")
    say(*(f"{name}: read back, against the model: {error}" for name, error in kit_errors(folder).items()))
    if install:
        _install(folder, into)
    if not check:
        return
    with progress_bar("developing") as progress:
        checks, notes = check_kit(folder, [*check, *(further_shots or [])], progress)
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


def config(
    profiles: Annotated[list[Path], argument("Profiles (.npz).")],
    output: Annotated[Path, option("A folder, or one archive (.ocioz).", "-o", "--output")] = Path("ocio"),
    merge: Annotated[
        str | None,
        option("A config to add the cameras to: a file, the name of a built-in one, or blender, for its own."),
    ] = None,
    replace: Annotated[bool, option("Replace the config that the folder holds.", "--replace")] = False,
    looks: Annotated[
        str | None,
        option("White balances, such as daylight,tungsten: looks change the others to the first, and back."),
    ] = None,
    profile_version: Annotated[str, option("2.1, or 2.5 with interoperability IDs and rules of views.")] = "2.1",
) -> None:
    """Write an OpenColorIO config with the cameras' RAW and JPEG colour spaces, views and refinish looks."""
    balances = [] if looks is None else [name.strip() for name in looks.split(",")]
    with progress_bar("config") as progress:
        written = lf.write_config(
            profiles, output, merge=merge, replace=replace, looks=balances, profile_version=profile_version,
            progress=progress,
        )  # fmt: skip
    note(*written.notes)
    counts = ((written.spaces, "input colour spaces"), (written.views, "view transforms"), (written.looks, "looks"))
    contents = ", ".join(f"{len(entries)} {title}" for entries, title in counts)
    say(f"{written.path}: profile version {written.version}, checked: {contents}")


def apply(
    grade: Annotated[Path, argument("A LUT file, a profile (.npz) or a config.")],
    images: Annotated[
        list[Path],
        argument("Files and folders: JPEG, PNG, TIFF, EXR, with a profile RAW; before them further profiles."),
    ],
    output: Annotated[Path | None, option("The folder for the graded images.", "-o", "--output")] = None,
    source: Annotated[
        str | None,
        option("STYLE/WB of the images, where they do not state it; with a config, their colour space.", "--from"),
    ] = None,
    target: Annotated[
        str | None, option("STYLE/WB wanted, as-shot to keep either; with a config, the colour space wanted.", "--to")
    ] = None,
    ev: Annotated[float, option("Exposure change in stops, with a profile.")] = 0.0,
    space: Annotated[
        str | None, option("Linear light instead of a look, with profiles: acescg, aces2065-1, linear-srgb … in .exr.")
    ] = None,
    exposure: Annotated[
        str | None, option("With --space: exif divides by time, ISO and aperture, so that pictures of a scene agree.")
    ] = None,
    view: Annotated[
        str | None, option("With a config, in place of --to: the view through which the images are seen.")
    ] = None,
    display: Annotated[str | None, option("With --view: the display that shows it, else the config's first.")] = None,
    look: Annotated[Path | None, option("The profile of the camera whose look is wanted.", "--as")] = None,
    transfer: Annotated[Path | None, option("With --as: RAW to RAW, from `lutforge transfer`.")] = None,
    suffix: Annotated[str | None, option("Another format for the output, such as .png or .exr.")] = None,
    workers: Annotated[int | None, option("Threads; one per core by default.")] = None,
    resume: Annotated[bool, option("Skip what an earlier run did that is still right.", "--resume")] = False,
    scheduler: Annotated[str | None, option("A Dask cluster that does the work: tcp://HOST:PORT.")] = None,
    print_commands: Annotated[
        bool, option("Grade nothing: print oiiotool lines that would, for a farm.", "--print-commands")
    ] = False,
    as_json: Annotated[bool, option("Print the summary as JSON, for programs.", "--json")] = False,
) -> None:
    """Grade images through OpenColorIO; metadata, bit depth and extra channels are kept."""
    from lutforge.pipeline.grading import Grading

    grading = Grading(
        (grade, *images), output, source, target, ev, look, transfer, suffix, workers, resume,
        scheduler, space, exposure, view, display,
    )  # fmt: skip
    failed = False
    if print_commands:
        for command in grading.commands():
            if isinstance(command, str):
                print(command)
            else:
                failed = True
                complain(command.reason)
    else:
        failed = _run(grading, as_json)
    if failed:
        raise typer.Exit(1 if len(grading.inputs[0]) > 1 else 2)


def _run(grading: "Grading", as_json: bool) -> bool:
    """Grade, and print the outcome for each image. Returns True where one failed."""
    from lutforge.grading.batch import rate

    began = time.monotonic()
    with quiet_codecs(), progress_bar("grading") as progress:
        result = grading.run(progress)
    seconds = time.monotonic() - began
    notes = ((done.source, text) for done in result.done for text in done.notes)
    note(*result.notes, *in_common(notes, "images"))
    first: dict[str, Path] = {}
    for failure in result.failed:
        reason = failure.reason.removeprefix(f"{failure.source}: ")
        first_source = first.setdefault(reason, failure.source)
        complain(failure.reason if first_source == failure.source else f"{failure.source}: as {first_source}")
    if as_json:
        graded = [
            {"source": str(done.source), "output": str(done.target)}
            | {"width": done.width, "height": done.height, "notes": done.notes}
            for done in result.done
        ]
        failed = [{"source": str(failure.source), "reason": failure.reason} for failure in result.failed]
        document = {"graded": graded, "skipped": list(map(str, result.skipped)), "failed": failed}
        print(json.dumps({**document, "seconds": round(seconds, 3)}, indent=1))
    else:
        say(*(str(done.target) for done in result.done))
    if len(grading.inputs[0]) > 1:
        pixels = sum(done.width * done.height for done in result.done)
        counts = f"{len(result.done)} graded, {len(result.skipped)} skipped, {len(result.failed)} failed"
        note(f"{counts} in {seconds:.1f} s: {rate(len(result.done), pixels, seconds)}")
    return bool(result.failed)
