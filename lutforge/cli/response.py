"""`lutforge response`: a bracket of a camera without RAW → a profile with its response."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import ProfileOutput, note, print_table, progress_bar, say


def response(
    bracket: Annotated[
        list[Path],
        typer.Argument(help="Pictures of one still scene, a folder of them, or a film of it.", show_default=False),
    ],
    output: ProfileOutput = Path("camera.npz"),
    times: Annotated[
        str | None, typer.Option(help="Exposure times in the order of the files, such as 1/60,1/30,1/15.")
    ] = None,
    camera: Annotated[str, typer.Option(help="The camera's name, where the files do not tell it.")] = "",
    all_colours: Annotated[
        bool, typer.Option("--all-colours", help="Count saturated colours, too: for a scene without neutral ones.")
    ] = False,
) -> None:
    """Find the response of a camera without RAW from one scene at several exposures, and how exact these were."""
    from lutforge.pipeline.response import parse_times, write_response

    with progress_bar("response") as report:
        fitted = write_response(
            bracket, output, None if times is None else parse_times(times), camera=camera, all_colours=all_colours,
            progress=report,
        )  # fmt: skip
    fit, profile = fitted.fit, fitted.profile
    say(f"{output}: {profile.camera}, {', '.join(profile.styles)}/{', '.join(profile.white_balances)}")
    say(
        f"EMoR with {fit.basis_curves} curves, from {fit.pairs} pairs of patches; pairs of shots that it had not seen "
        f"are predicted to {fit.held_out:.1f} codes (median)"
    )
    rows = [(curve.name, f"{curve.median:.1f}", f"{curve.rms:.1f}") for curve in fit.curves]
    print_table("Error of the next exposure in codes, exposures as stated", ("curve", "median", "RMS"), rows)
    exposures = fitted.exposure_s
    print_table(
        "Exposures",
        ("shot", "stated, relative", "true / stated"),
        [
            (name, f"{time / min(exposures.values()):.4g}", f"{fit.exposure_error.get(name, float('nan')):.3f}")
            for name, time in exposures.items()
        ],
    )
    say(f"JPEG values follow the exposure from {255 * fit.black.max():.0f} to {255 * fit.white.min():.0f}")
    verdict = fit.verdict
    say(
        f"the response {'is a fixed property of this camera' if verdict.fixed else 'is not the same in all shots'}: "
        f"unsaturated colours of the worst shot depart by {255 * verdict.shift:.1f} codes, "
        f"{verdict.outliers:.0%} of all colours by more than 3"
    )
    if not verdict.fixed:
        note("fix exposure mode, white balance and picture style, and switch off what adapts to the scene (HDR, DRO)")
