"""The command that grades pictures."""

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
        paths=(grade, *images),
        output=output,
        source=source,
        target=target,
        ev=ev,
        look=look,
        transfer=transfer,
        suffix=suffix,
        workers=workers,
        resume=resume,
        scheduler=scheduler,
        space=space,
        exposure=exposure,
        view=view,
        display=display,
    )
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
