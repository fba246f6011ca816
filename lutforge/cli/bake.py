"""The command that bakes LUTs and camera profiles."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, argument, note, option, progress_bar, say
from lutforge.cli.program_names import LUT_PROGRAMS


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
            f"The program that will read it, which without -o names the files: {', '.join(LUT_PROGRAMS)}.",
            "--for",
            autocompletion=lambda: list(LUT_PROGRAMS),
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
    from lutforge.pipeline.bake_plan import BakeOptions
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.transforms import TransformRequest

    request = TransformRequest(kind, source, target, ev, space, model, other, transfer)
    options = BakeOptions(
        program=reader, size=size, tolerance=tolerance, interpolation=interpolation, clf_version=clf_version
    )
    with progress_bar("baking") as progress:
        files, notes = bake_files(profile, request, output or (), options, colours=colours, progress=progress)
    for file in files:
        say(*str(file).splitlines())
    note(*notes)
