"""`lutforge apply`: grade images with a LUT, a profile or an OpenColorIO config."""

import json
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import argument, complain, note, option, progress_bar, quiet_codecs, say
from lutforge.errors import in_common

if TYPE_CHECKING:
    from lutforge.pipeline.grading import Grading


def apply(
    grade: Annotated[Path, argument("A LUT file, a profile (.npz) or a config.")],
    images: Annotated[
        list[Path], argument("Images: JPEG, PNG, TIFF, EXR, with a profile RAW; before them further profiles.")
    ],
    output: Annotated[Path | None, option("The folder for the graded images.", "-o", "--output")] = None,
    source: Annotated[
        str | None,
        option("STYLE/WB of the images, where they do not tell; with a config, their colour space.", "--from"),
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
    look: Annotated[Path | None, option("The profile of the camera whose look is wanted.", "--as")] = None,
    transfer: Annotated[
        list[Path] | None, option("With --as: RAW to RAW, from `lutforge transfer`; may repeat.")
    ] = None,
    suffix: Annotated[str | None, option("Another format for the output, such as .png or .exr.")] = None,
    quality: Annotated[int | None, option("Of JPEG files, 1 to 100, if not as their sources.")] = None,
    interpolation: Annotated[str, option("trilinear or tetrahedral, for LUTs that do not say it.")] = "tetrahedral",
    workers: Annotated[int | None, option("Threads; one per core by default.")] = None,
    frames: Annotated[str | None, option("Frames of sequences: 1001-1100, 1-9x2, 1,5,9.")] = None,
    recursive: Annotated[bool, option("Folders with their subfolders.", "--recursive")] = False,
    resume: Annotated[bool, option("Skip what an earlier run did that is still right.", "--resume")] = False,
    scheduler: Annotated[str | None, option("A Dask cluster that does the work: tcp://HOST:PORT.")] = None,
    print_commands: Annotated[
        bool, option("Grade nothing: print oiiotool lines that would, for a farm.", "--print-commands")
    ] = False,
    as_json: Annotated[bool, option("Print the summary as JSON, for programs.", "--json")] = False,
) -> None:
    """Grade images through OpenColorIO; metadata, bit depth and extra channels are kept.

    IMAGES are files, folders, and sequences: shot.####.exr, shot.1001-1100####.exr, shot.%04d.exr.
    """
    from lutforge.child_processes import prepare

    if grade.suffix.lower() not in (".npz", ".ocio", ".ocioz"):
        prepare("lutforge.luts.reading")  # what reads the LUT first loads beside what grades
    from lutforge.pipeline.grading import Grading

    grading = Grading(
        (grade, *images), output, source, target, ev, look, tuple(transfer or ()), interpolation, suffix, workers,
        frames, recursive, resume, scheduler, quality, space, exposure,
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
        raise typer.Exit(1 if grading.asked > 1 else 2)


def _run(grading: "Grading", as_json: bool) -> bool:
    """Grade, and say what became of the images. Returns whether one failed."""
    from lutforge.apply.batch import rate

    began = time.monotonic()
    with quiet_codecs(), progress_bar("grading") as progress:
        result = grading.run(progress)
    seconds = time.monotonic() - began
    notes = ((done.source, text) for done in result.done for text in done.notes)
    note(*result.notes, *in_common(notes, "images"))
    first: dict[str, Path] = {}
    for failure in result.failed:
        reason = failure.reason.removeprefix(f"{failure.source}: ")
        same = first.setdefault(reason, failure.source)
        complain(failure.reason if same == failure.source else f"{failure.source}: as {same}")
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
    if grading.asked > 1:
        pixels = sum(done.width * done.height for done in result.done)
        counts = f"{len(result.done)} graded, {len(result.skipped)} skipped, {len(result.failed)} failed"
        note(f"{counts} in {seconds:.1f} s: {rate(len(result.done), pixels, seconds)}")
    return bool(result.failed)
