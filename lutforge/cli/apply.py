"""`lutforge apply`: grade images with a LUT, a profile or an OpenColorIO config."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import err, note, progress_bar, say
from lutforge.errors import ConfigError, LutError, SettingsError
from lutforge.interpolation import INTERPOLATIONS

if TYPE_CHECKING:
    import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses


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
    if grade.suffix.lower() == ".npz":
        processor, what = _profile_processor(grade, source, target, ev)
    elif grade.suffix.lower() in (".ocio", ".ocioz"):
        processor, what = _config_processor(grade, source, target)
    else:
        if source is not None or target is not None or ev:
            raise SettingsError("--from, --to and --ev go with a profile or a config; a LUT is applied as it is")
        from lutforge.luts.processor import file_processor

        pair = {".spi1d": ".spi3d", ".spi3d": ".spi1d"}.get(grade.suffix.lower())
        if pair is not None and grade.with_suffix(pair).is_file():
            raise LutError(
                f"{grade}: half of a LUT, {grade.with_suffix(pair).name} is the other; bake a .clf or .cube to apply, "
                "or use the two in an OpenColorIO config"
            )
        processor, what = file_processor(grade, interpolation), f"graded with {grade.name}"
    with progress_bar("grading") as report:
        result = apply_batch(
            processor,
            images,
            output,
            suffix,
            workers=workers,
            progress=lambda done, count, path: report(path.name, done / count),
            note=what,
        )
    for done in result.done:
        say(str(done.target))
        for text in done.notes:
            note(text)
    for failure in result.failed:
        err.print(f"lutforge: {failure.reason}", markup=False)
    if result.failed:
        raise typer.Exit(2 if len(images) == 1 else 1)


def _profile_processor(
    path: Path, source: str | None, target: str | None, ev: float
) -> tuple["OCIO.CPUProcessor", str]:
    """The refinish, baked, as OpenColorIO evaluates it."""
    from lutforge.cli.bake import choose_transform
    from lutforge.luts.bake import bake
    from lutforge.luts.processor import file_processor
    from lutforge.luts.write import write_lut
    from lutforge.model.profile_file import load_profile

    profile = load_profile(path)
    if target is None and source is not None:
        target = source
    transform, title = choose_transform(profile, "refinish", None, source, target, ev, "raw", None)
    with TemporaryDirectory() as folder:
        written = write_lut(bake(transform, interpolation="tetrahedral"), Path(folder) / "refinish.clf")
        return file_processor(written.path, "tetrahedral"), title


def _config_processor(path: Path, source: str | None, target: str | None) -> tuple["OCIO.CPUProcessor", str]:
    from lutforge.luts.processor import OCIO_ERRORS
    from lutforge.ocio.check import load_config

    config = load_config(path)
    known = ", ".join(config.getColorSpaceNames())
    if source is None or target is None:
        raise ConfigError(f"{path}: name two of its colour spaces with --from and --to: {known}")
    for name in (source, target):
        if config.getColorSpace(name) is None:
            raise ConfigError(f'{path}: no colour space "{name}"; it has {known}')
    try:
        return config.getProcessor(source, target).getDefaultCPUProcessor(), f"{source} to {target}"
    except OCIO_ERRORS as error:
        raise ConfigError(f"{path}: {' '.join(str(error).split())}") from error
