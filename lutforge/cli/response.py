"""`lutforge response`: a bracket of a camera without RAW → a profile with its response."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

from lutforge.cli.console import ProfileOutput, argument, note, option, print_tables, progress_bar, say
from lutforge.report.tables import Table, held_out_table, response_table


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
            "patches (CGATS .txt) tells. The whole rendering is calibrated on its colours."
        ),
    ] = None,
    light: Annotated[str | None, option("The light on the chart: 5500K, D55, A, LED-B3 …", show_default="D50")] = None,
    corners: Annotated[
        str | None, option('The chart\'s outer corners in pixels, clockwise from the first patch: "x,y x,y x,y x,y".')
    ] = None,
) -> None:
    """Find the response of a camera without RAW from one scene at several exposures, and how exact these were."""
    from lutforge.pipeline.charts import FittedChart, ResponseRequest
    from lutforge.pipeline.outputs import named_or_new
    from lutforge.pipeline.sampling import CHART

    output = named_or_new(output, "camera.npz")
    words = (times or "", camera, all_colours, chart or "", light or "", corners or "")
    with progress_bar("response") as progress:
        fitted = ResponseRequest(tuple(bracket), *words).fit(output, progress)
    fit, profile, exposures = fitted.fit, fitted.profile, fitted.exposure_s
    (selector,) = (f"{style}/{balance}" for style in profile.styles for balance in profile.white_balances)
    least, error = min(exposures.values()), fit.exposure_error
    known, follows = fit.told
    columns: dict[str, Iterable[str]] = {
        "shot": exposures,
        "stated, relative": [f"{time / least:.4g}" for time in exposures.values()],
        "true / stated": [f"{error[name]:.3f}" if name in error else "–" for name in exposures],
    }
    if isinstance(fitted, FittedChart):
        say(f"{output}: {profile.camera}, {selector}, of the {profile.developer.removeprefix(CHART)}")
        used = {name: str(len(rows)) for name, rows in fitted.samples.by_shot()}
        seen = ["found" if name in fitted.found else "" for name in exposures]
        columns = {
            "shot": exposures,
            "chart": seen,
            "patches used": [used.get(name, "0") for name in exposures],
        } | columns
        columns["white beside the chart"] = [f"{fitted.level[name]:.3g}" for name in exposures]
    else:
        say(f"{output}: {profile.camera}, {selector}", known)
        print_tables(response_table(fit))
    print_tables(Table("Exposures", list(columns), list(zip(*columns.values(), strict=True))))
    if not isinstance(fitted, FittedChart):
        say(follows)
    elif corners is None and (missed := ", ".join(name for name in exposures if name not in fitted.found)):
        note(f"the chart was not found in {missed}: its place in the nearest exposure was taken; see --corners")
    say(fit.verdict.told)
    if not fit.verdict.fixed:
        note("fix exposure mode, white balance and picture style, and switch off what adapts to the scene (HDR, DRO)")
    to = "-o linear.cube"
    if isinstance(fitted, FittedChart):
        note(*profile.notes)
        print_tables(held_out_table(profile))
        to = "--space aces2065-1 -o input.clf"
    say(f"next: lutforge bake {output} linearize --from {selector} {to}")
