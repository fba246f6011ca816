"""`lutforge response`: a bracket of a camera without RAW → a profile with its response."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import ProfileOutput, argument, note, option, print_tables, progress_bar, say
from lutforge.errors import CalibrationError
from lutforge.report.tables import Table, held_out_table, response_table

if TYPE_CHECKING:
    from lutforge.calibration.physical.bracket import BracketFit


def response(
    bracket: Annotated[list[Path], argument("Pictures of one still scene, a folder of them, or a film of it.")],
    output: ProfileOutput = None,
    times: Annotated[str | None, option("Exposure times in the order of the files, such as 1/60,1/30,1/15.")] = None,
    camera: Annotated[str, option("The camera's name, where the files do not tell it.")] = "",
    all_colours: Annotated[
        bool, option("Count saturated colours, too: for a scene without neutral ones.", "--all-colours")
    ] = False,
    chart: Annotated[
        str | None,
        option(
            "The scene shows this chart: classic, classic2014, sg, spyder24, spyder48, or what a file of measured "
            "patches (CGATS .txt) or a .json tells. The whole rendering is calibrated on its colours."
        ),
    ] = None,
    light: Annotated[str | None, option("The light on the chart: 5500K, D55, A, LED-B3 …", show_default="D50")] = None,
    corners: Annotated[
        str | None, option('The chart\'s outer corners in pixels, clockwise from the first patch: "x,y x,y x,y x,y".')
    ] = None,
) -> None:
    """Find the response of a camera without RAW from one scene at several exposures, and how exact these were."""
    from lutforge.pipeline.outputs import named_or_new
    from lutforge.pipeline.response import parse_times

    output = named_or_new(output, "camera.npz")
    exposure_s = None if times is None else parse_times(times)
    if chart is not None:
        _of_chart(bracket, output, chart, light or "D50", corners, exposure_s, camera)
        return
    for name, value in (("--light", light), ("--corners", corners)):
        if value is not None:
            raise CalibrationError(f"{name} is of a colour chart: name the chart, too, such as --chart classic")
    from lutforge.pipeline.response import response as fit_response

    with progress_bar("response") as progress:
        fitted = fit_response(bracket, output, exposure_s, camera=camera, all_colours=all_colours, progress=progress)
    fit, profile, exposures = fitted.fit, fitted.profile, fitted.exposure_s
    (selector,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    say(f"{output}: {profile.camera}, {selector}")
    known, follows = fit.told
    say(known)
    print_tables(response_table(fit))
    rows = [
        (name, f"{time / min(exposures.values()):.4g}", _true_over_stated(fit, name))
        for name, time in exposures.items()
    ]
    print_tables(Table("Exposures", ("shot", "stated, relative", "true / stated"), rows))
    say(follows)
    _tell_verdict(fit)
    say(f"next: lutforge bake {output} linearize --from {selector} -o linear.cube")


def _of_chart(
    bracket: list[Path], output: Path, chart: str, light: str, corners: str | None,
    exposure_s: list[float] | None, camera: str,
) -> None:  # fmt: skip
    """Calibrate on exposures of a chart, and print what they tell."""
    from lutforge.pipeline.charts import write_input_transform
    from lutforge.samples.chart_kinds import chart_kind, parse_corners

    kind, places = chart_kind(chart), None if corners is None else parse_corners(corners)
    with progress_bar("response") as progress:
        fitted = write_input_transform(
            bracket, output, kind, light, places, exposure_s, camera=camera, progress=progress
        )
    profile, exposures = fitted.profile, fitted.exposure_s
    (selector,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    say(f"{output}: {profile.camera}, {selector}, of the {kind.name} under {light}")
    used = {name: len(rows) for name, rows in fitted.samples.by_shot()}
    rows = [
        (
            name, "found" if name in fitted.found else "", str(used.get(name, 0)),
            f"{time / min(exposures.values()):.4g}", _true_over_stated(fitted.fit, name),
            f"{fitted.level[name]:.3g}",
        )
        for name, time in exposures.items()
    ]  # fmt: skip
    header = ("shot", "chart", "patches used", "stated, relative", "true / stated", "white beside the chart")
    print_tables(Table("Exposures", header, rows))
    missed = ", ".join(name for name in exposures if name not in fitted.found)
    if missed and corners is None:
        note(f"the chart was not found in {missed}: its place in the nearest exposure was taken; see --corners")
    _tell_verdict(fitted.fit)
    note(*profile.notes)
    print_tables(held_out_table(profile))
    say(f"next: lutforge bake {output} linearize --from {selector} --space aces2065-1 -o input.clf")


def _true_over_stated(fit: "BracketFit", name: str) -> str:
    return f"{fit.exposure_error[name]:.3f}" if name in fit.exposure_error else "–"


def _tell_verdict(fit: "BracketFit") -> None:
    say(fit.verdict.told)
    if not fit.verdict.fixed:
        note("fix exposure mode, white balance and picture style, and switch off what adapts to the scene (HDR, DRO)")
