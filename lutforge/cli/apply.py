"""`lutforge apply`: grade images with a LUT, a profile or an OpenColorIO config."""

import json
import re
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import err, note, progress_bar, quiet_codecs, say
from lutforge.errors import ImageError, SettingsError
from lutforge.interpolation import INTERPOLATIONS

PROFILE = ".npz"
MOST_NOTES = 3
"""Images that have the same to be told of them, each in a line of its own."""

if TYPE_CHECKING:
    from lutforge.apply.batch import BatchResult, Failure
    from lutforge.apply.grade import Recipe
    from lutforge.apply.image import Applied
    from lutforge.apply.inputs import Inputs


def apply(
    grade: Annotated[Path, typer.Argument(help="A LUT file, a profile (.npz) or a config.", show_default=False)],
    images: Annotated[
        list[Path],
        typer.Argument(
            help="Images: JPEG, PNG, TIFF, EXR, with a profile RAW; before them further profiles.", show_default=False
        ),
    ],
    output: Annotated[Path | None, typer.Option("-o", "--output", help="The folder for the graded images.")] = None,
    source: Annotated[
        str | None,
        typer.Option(
            "--from", help="STYLE/WB of the images, where they do not tell; with a config, their colour space."
        ),
    ] = None,
    target: Annotated[
        str | None,
        typer.Option("--to", help="STYLE/WB wanted, as-shot to keep either; with a config, the colour space wanted."),
    ] = None,
    ev: Annotated[float, typer.Option(help="Exposure change in stops, with a profile.")] = 0.0,
    look: Annotated[Path | None, typer.Option("--as", help="The profile of the camera whose look is wanted.")] = None,
    transfer: Annotated[
        list[Path] | None, typer.Option(help="With --as: RAW to RAW, from `lutforge transfer`; may repeat.")
    ] = None,
    candidates: Annotated[
        Path | None, typer.Option(help="Grade nothing: a sheet of the image under presumed white balances, --to one.")
    ] = None,
    suffix: Annotated[str | None, typer.Option(help="Another format for the output, such as .png or .exr.")] = None,
    interpolation: Annotated[str, typer.Option(help="For LUTs that name none.")] = "tetrahedral",
    workers: Annotated[int | None, typer.Option(help="Threads; one per core by default.")] = None,
    frames: Annotated[str | None, typer.Option(help="Frames of sequences: 1001-1100, 1-9x2, 1,5,9.")] = None,
    recursive: Annotated[bool, typer.Option("--recursive", help="Folders with their subfolders.")] = False,
    mask: Annotated[Path | None, typer.Option(help="A folder for each grade's confidence as an image.")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Skip what an earlier run did that is still right.")] = False,
    scheduler: Annotated[str | None, typer.Option(help="A Dask cluster that does the work: tcp://HOST:PORT.")] = None,
    print_commands: Annotated[
        bool, typer.Option("--print-commands", help="Grade nothing: print oiiotool lines that would, for a farm.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the summary as JSON, for programs.")] = False,
) -> None:
    """Grade images through OpenColorIO; metadata, bit depth and extra channels are kept.

    IMAGES are files, folders, and sequences: shot.####.exr, shot.1001-1100####.exr, shot.%04d.exr.
    """
    from lutforge.apply.batch import apply_batch
    from lutforge.apply.inputs import find_inputs

    profiles = (grade, *(path for path in images if path.suffix.lower() == PROFILE))
    pictures = [path for path in images if path.suffix.lower() != PROFILE]
    if not pictures:
        raise SettingsError("no image named: give the images after the profiles")
    if workers is not None and workers < 1:
        raise SettingsError(f"--workers {workers}: at least one thread is needed")
    recipe = _recipe(profiles, source, target, ev, look, tuple(transfer or ()), interpolation)
    recipe.check()
    if candidates is not None:
        _candidates(recipe, pictures, candidates)
        return
    if output is None:
        raise SettingsError("no output: name a folder for the graded images with -o")
    if output.exists() and not output.is_dir():
        raise ImageError(f"{output}: is not a folder; name a folder for the graded images")
    leave_out = [output] if mask is None else [output, mask]
    inputs = find_inputs(pictures, frames, recursive, leave_out, raw=grade.suffix.lower() == PROFILE)
    if print_commands:
        _print_commands(recipe, inputs, output, suffix)
        return
    began = time.monotonic()
    with quiet_codecs(), progress_bar("grading") as report:
        result = apply_batch(
            recipe,
            inputs.images,
            output,
            suffix,
            workers=workers,
            progress=lambda now: report(_rate(now.images, now.pixels, now.seconds), now.share),
            masks=mask,
            resume=resume,
            scheduler=scheduler,
        )
    _tell(inputs, result, time.monotonic() - began, as_json)


def _recipe(
    paths: tuple[Path, ...],
    source: str | None,
    target: str | None,
    ev: float,
    look: Path | None,
    transfers: tuple[Path, ...],
    interpolation: str,
) -> "Recipe":
    """The recipe of profiles, or of one LUT or config. Raises SettingsError where an option does not go with it."""
    from lutforge.apply.grade import ConfigRecipe, LutRecipe
    from lutforge.apply.profile_recipe import ProfileRecipe

    if interpolation not in INTERPOLATIONS:
        raise SettingsError(f'unknown interpolation "{interpolation}"; choose {" or ".join(INTERPOLATIONS)}')
    path, *others = paths
    if path.suffix.lower() == PROFILE:
        return ProfileRecipe(paths, source, target, ev, look, transfers)
    if look is not None or transfers or others:
        raise SettingsError("--as, --transfer and several profiles go with profiles (.npz) only")
    if path.suffix.lower() in (".ocio", ".ocioz"):
        return ConfigRecipe(path, source, target)
    if source is not None or target is not None or ev:
        raise SettingsError("--from, --to and --ev go with a profile or a config; a LUT is applied as it is")
    return LutRecipe(path, interpolation)


def _tell(inputs: "Inputs", result: "BatchResult", seconds: float, as_json: bool) -> None:
    """Say what became of the images. Raises typer.Exit where one failed: 2 where it was the only one, else 1."""
    from lutforge.apply.batch import Failure

    failed = (*result.failed, *(Failure(path, f"{path}: this frame is missing") for path in inputs.missing))
    for text in (*inputs.notes, *result.notes, *_notes(result.done)):
        note(text)
    for failure in failed:
        err.print(f"lutforge: {failure.reason}", markup=False)
    if as_json:
        _print_json(result, failed, seconds)
    else:
        for done in result.done:
            say(str(done.target))
    asked = len(inputs.images) + len(inputs.missing)
    if asked > 1:
        pixels = sum(done.width * done.height for done in result.done)
        counts = f"{len(result.done)} graded, {len(result.skipped)} skipped, {len(failed)} failed"
        note(f"{counts} in {seconds:.1f} s: {_rate(len(result.done), pixels, seconds)}")
    if failed:
        raise typer.Exit(1 if asked > 1 else 2)


def _notes(graded: "Sequence[Applied]") -> Iterator[str]:
    """What there is to know of the images; what many have in common, but for its numbers, in one line."""
    alike: dict[str, list[tuple[Path, str]]] = {}
    for done in graded:
        for text in done.notes:
            alike.setdefault(re.sub(r"[\d.]+", "", text), []).append((done.source, text))
    for images in alike.values():
        if len(images) > MOST_NOTES:
            source, text = images[0]
            yield f"{len(images)} images, such as {source}: {text}"
        else:
            yield from (f"{source}: {text}" for source, text in images)


def _candidates(recipe: "Recipe", images: Sequence[Path], sheet: Path) -> None:
    from lutforge.apply.candidates import candidate_sheet
    from lutforge.apply.profile_recipe import ProfileRecipe

    if not isinstance(recipe, ProfileRecipe) or len(images) != 1:
        raise SettingsError("--candidates goes with a profile and one image")
    for name in candidate_sheet(recipe, images[0], sheet):
        say(f"--from {name}")
    note(f"{sheet} shows the picture graded from each; grade it from the one that looks right")


def _print_commands(recipe: "Recipe", inputs: "Inputs", output: Path, suffix: str | None) -> None:
    from lutforge.apply.batch import Failure, plan_jobs
    from lutforge.apply.oiiotool_commands import oiiotool_commands

    failed = [f"{path}: this frame is missing" for path in inputs.missing]
    for command in oiiotool_commands(recipe, plan_jobs(inputs.images, output, suffix), output / "luts"):
        if isinstance(command, Failure):
            failed.append(command.reason)
        else:
            print(command)
    for line in failed:
        err.print(f"lutforge: {line}", markup=False)
    if failed:
        raise typer.Exit(1)


def _rate(images: int, pixels: int, seconds: float) -> str:
    seconds = max(seconds, 1e-3)
    return f"{images / seconds:.2g} images/s, {pixels / 1e6 / seconds:.3g} Mpixel/s"


def _print_json(result: "BatchResult", failed: "Sequence[Failure]", seconds: float) -> None:
    graded = [
        {"source": str(done.source), "output": str(done.target), "mask": str(done.mask) if done.mask else None}
        | {"width": done.width, "height": done.height, "notes": done.notes}
        for done in result.done
    ]
    document = {
        "graded": graded,
        "skipped": [str(path) for path in result.skipped],
        "failed": [{"source": str(failure.source), "reason": failure.reason} for failure in failed],
        "seconds": round(seconds, 3),
    }
    json.dump(document, sys.stdout, indent=1)
    print()
