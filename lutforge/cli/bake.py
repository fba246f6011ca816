"""`lutforge bake`: a profile's transform → LUT files, each read back and measured."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, argument, note, option, progress_bar, say

PROGRAMS = (
    "resolve, nuke, ocio, oiio, baselight, flame, houdini, blender, photoshop, lightroom, premiere, aftereffects, "
    "finalcut, affinity, ffmpeg, mlt, obs, darktable, rawtherapee, art, captureone, digikam, rapidraw, gmic, gimp, "
    "imagemagick"
)
"""As `lutforge.luts.programs` has them, which takes a second to load."""


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
            f"The program that will read it, which without -o names the files: {PROGRAMS}.",
            "--for",
            autocompletion=lambda: PROGRAMS.split(", "),
        ),
    ] = None,
    size: Annotated[int | None, option("Nodes per axis of the cube.")] = None,
    tolerance: Annotated[float | None, option("Instead of a size: the ΔE00 that 99 % of colours keep within.")] = None,
    interpolation: Annotated[str | None, option("trilinear or tetrahedral: how the reader interpolates.")] = None,
    model: Annotated[str | None, option("lattice or rbf, where the profile holds both.")] = None,
    transfer: Annotated[
        list[Path] | None, option("For match: RAW to RAW, from `lutforge transfer`; may repeat, in steps.")
    ] = None,
    colours: Annotated[
        bool, option(".icc: without the camera's tone curve, scene-linear, for one's own tone mapper.", "--colours")
    ] = False,
) -> None:
    """Bake RAW → JPEG (render), JPEG → scene (linearize), JPEG → JPEG (refinish), or camera → camera (match)."""
    from lutforge.pipeline.baking import bake_files
    from lutforge.pipeline.transforms import TransformRequest

    wanted = TransformRequest(kind, source, target, ev, space, model, other, tuple(transfer or ()))
    with progress_bar("baking") as progress:
        files, notes = bake_files(
            profile, wanted, output or (), program=reader, size=size, tolerance=tolerance, interpolation=interpolation,
            colours=colours, progress=progress,
        )  # fmt: skip
    for file in files:
        say(*str(file).splitlines())
    note(*notes)
