"""The command that finds the response of a camera without RAW, from a bracket or from one picture of a chart."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import ProfileOutput, argument, note, option, print_tables, progress_bar, say
from lutforge.reports.tables import Table, held_out_table, response_table

if TYPE_CHECKING:
    from lutforge.model.camera_profile import CameraProfile
    from lutforge.pipeline.response import FittedResponse
    from lutforge.pipeline.response_request import ResponseRequest


def response(
    bracket: Annotated[list[Path], argument("Pictures of one still scene, or a folder of them.")],
    output: ProfileOutput = None,
    times: Annotated[str | None, option("Exposure times in the order of the files, such as 1/60,1/30,1/15.")] = None,
    camera: Annotated[str, option("The camera's name, where the files do not state it.")] = "",
    all_colours: Annotated[
        bool, option("Count saturated colours, too: for a scene without neutral ones.", "--all-colours")
    ] = False,
    chart: Annotated[
        str | None,
        option(
            "The scene shows this chart: classic, classic2014, sg, spyder24 or spyder48. "
            "The whole rendering is calibrated on its colours."
        ),
    ] = None,
    light: Annotated[str | None, option("The light on the chart: 5500K, D55, A, LED-B3 …", show_default="D50")] = None,
    corners: Annotated[
        str | None, option('The chart\'s outer corners in pixels, clockwise from the first patch: "x,y x,y x,y x,y".')
    ] = None,
) -> None:
    """Find the response of a camera without RAW from one scene at several exposures, and how exact these were."""
    from lutforge.pipeline.outputs import named_or_new
    from lutforge.pipeline.response_request import ResponseRequest

    output = named_or_new(output, "camera.npz")
    request = ResponseRequest(
        files=tuple(bracket),
        times=times or "",
        camera=camera,
        all_colours=all_colours,
        chart=chart or "",
        light=light or "",
        corners=corners or "",
    )
    if request.is_one_picture:
        _approximate(request, output)
    else:
        _fit(request, output)


def _approximate(request: "ResponseRequest", output: Path) -> None:
    """Find an approximate response from one picture of a chart, and print it."""
    with progress_bar("response") as progress:
        approximate = request.approximate(output, progress)
    profile = approximate.profile
    say(f"{output}: {profile.camera}, {_setting(profile)}", *approximate.notes)
    _print_next(output, profile, of_chart=True)


def _fit(request: "ResponseRequest", output: Path) -> None:
    """Fit the response to a bracket; print it, the errors of the exposures, and the next command."""
    from lutforge.model.provenance import Chart

    with progress_bar("response") as progress:
        fitted = request.fit(output, progress)
    fit = fitted.fit
    profile = fitted.profile
    chart = profile.provenance if isinstance(profile.provenance, Chart) else None
    on_error, on_range = fit.statements
    if chart is not None:
        say(f"{output}: {profile.camera}, {_setting(profile)}, of the {chart.lit}")
        print_tables(_exposures(fitted, of_chart=True))
        if not request.corners:
            _note_missed_charts(fitted)
    else:
        say(f"{output}: {profile.camera}, {_setting(profile)}", on_error)
        print_tables(response_table(fit), _exposures(fitted, of_chart=False))
        say(on_range)

    say(fit.verdict.words)
    if not fit.verdict.fixed:
        note("fix exposure mode, white balance and picture style, and switch off what adapts to the scene (HDR, DRO)")
    if chart is not None:
        note(*profile.notes)
        print_tables(held_out_table(profile))
    _print_next(output, profile, of_chart=chart is not None)


def _exposures(fitted: "FittedResponse", of_chart: bool) -> Table:
    """The exposures of a bracket: as stated, and what they were; of a chart, what was found of it in each."""
    exposures = fitted.exposure_s
    error = fitted.fit.exposure_error
    shortest = min(exposures.values())
    columns: dict[str, Iterable[str]] = {"shot": exposures}
    if of_chart and fitted.samples is not None:
        used = {name: str(len(rows)) for name, rows in fitted.samples.by_shot()}
        columns["chart"] = ["found" if name in fitted.found else "" for name in exposures]
        columns["patches used"] = [used.get(name, "0") for name in exposures]
    columns["stated, relative"] = [f"{time / shortest:.4g}" for time in exposures.values()]
    columns["true / stated"] = [f"{error[name]:.3f}" if name in error else "–" for name in exposures]
    if of_chart:
        columns["white beside the chart"] = [f"{fitted.level[name]:.3g}" for name in exposures]
    return Table("Exposures", list(columns), list(zip(*columns.values(), strict=True)))


def _note_missed_charts(fitted: "FittedResponse") -> None:
    """Print a note on the exposures in which the chart was not found."""
    missed = ", ".join(name for name in fitted.exposure_s if name not in fitted.found)
    if missed:
        note(f"the chart was not found in {missed}: its place in the nearest exposure was taken; see --corners")


def _setting(profile: "CameraProfile") -> str:
    """STYLE/WB of a profile that has one of each."""
    (setting,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    return setting


def _print_next(output: Path, profile: "CameraProfile", of_chart: bool) -> None:
    """Print the command that bakes the profile. of_chart: it knows colours, and not tones alone."""
    options = "--space aces2065-1 -o input.clf" if of_chart else "-o linear.cube"
    say(f"next: lutforge bake {output} linearize --from {_setting(profile)} {options}")
