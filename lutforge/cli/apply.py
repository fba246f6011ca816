"""`lutforge apply`: grade images with a LUT, a profile or an OpenColorIO config."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import err, note, progress_bar, say
from lutforge.errors import SettingsError
from lutforge.interpolation import INTERPOLATIONS, Interpolation

if TYPE_CHECKING:
    from lutforge.apply.grade import Recipe


def apply(
    grade: Annotated[Path, typer.Argument(help="A LUT file, a profile (.npz) or a config.", show_default=False)],
    images: Annotated[list[Path], typer.Argument(help="Images: JPEG, PNG, TIFF, EXR, …", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="The folder for the graded images.")],
    source: Annotated[
        str | None, typer.Option("--from", help="STYLE/WB of the images; with a config, their colour space.")
    ] = None,
    target: Annotated[
        str | None, typer.Option("--to", help="STYLE/WB wanted; with a config, the colour space wanted.")
    ] = None,
    ev: Annotated[float, typer.Option(help="Exposure change in stops, with a profile.")] = 0.0,
    suffix: Annotated[str | None, typer.Option(help="Another format for the output, such as .png or .exr.")] = None,
    interpolation: Annotated[str, typer.Option(help="For LUTs that name none.")] = "tetrahedral",
    workers: Annotated[int | None, typer.Option(help="Threads; one per core by default.")] = None,
) -> None:
    """Grade images through OpenColorIO; metadata, bit depth and extra channels are kept."""
    from lutforge.apply.batch import apply_batch

    if interpolation not in INTERPOLATIONS:
        raise SettingsError(f'unknown interpolation "{interpolation}"; choose {" or ".join(INTERPOLATIONS)}')
    if workers is not None and workers < 1:
        raise SettingsError(f"--workers {workers}: at least one thread is needed")
    recipe = _recipe(grade, source, target, ev, interpolation)
    recipe.check()
    with progress_bar("grading") as report:
        result = apply_batch(
            recipe,
            images,
            output,
            suffix,
            workers=workers,
            progress=lambda done, count, path: report(path.name, done / count),
        )
    for done in result.done:
        say(str(done.target))
        for text in done.notes:
            note(text)
    for failure in result.failed:
        err.print(f"lutforge: {failure.reason}", markup=False)
    if result.failed:
        raise typer.Exit(2 if len(images) == 1 else 1)


def _recipe(path: Path, source: str | None, target: str | None, ev: float, interpolation: Interpolation) -> "Recipe":
    from lutforge.apply.grade import ConfigRecipe, LutRecipe
    from lutforge.apply.profile_recipe import ProfileRecipe

    if path.suffix.lower() == ".npz":
        return ProfileRecipe(path, source, target, ev)
    if path.suffix.lower() in (".ocio", ".ocioz"):
        return ConfigRecipe(path, source, target)
    if source is not None or target is not None or ev:
        raise SettingsError("--from, --to and --ev go with a profile or a config; a LUT is applied as it is")
    return LutRecipe(path, interpolation)
