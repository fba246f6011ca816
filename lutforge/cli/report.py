"""`lutforge report`, `compare`: a profile, its errors and what to shoot next, or two cameras, as one HTML file."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, argument, option, progress_bar, say
from lutforge.cli.sample import tell


def report(
    profile: Profile,
    sources: Annotated[
        list[Path] | None, argument("What it was calibrated from: sample tables, RAW files, folders.")
    ] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("report.html"),
    figures: Annotated[Path | None, option("A folder for the figures, each as SVG and PNG.")] = None,
) -> None:
    """Write a report that needs no network: curves, maps and tables of a profile.

    With samples, the errors held out by shot and what to shoot next; with RAW files, error maps of real shots too.
    """
    from lutforge.model.camera_profile import as_profile
    from lutforge.pipeline.reports import check_report_output
    from lutforge.pipeline.reports import report as write_report
    from lutforge.pipeline.sampling import gather_samples

    check_report_output(output, figures, [profile, *(sources or [])])
    camera, sampled = as_profile(profile), None
    if sources:
        with progress_bar("sampling") as progress:
            sampled = gather_samples(sources, progress)
        tell(sampled)
    with progress_bar("reporting") as progress:
        page = write_report(camera, sampled, output, figures, progress)
    say(f"{output}: {len(page.pictures)} figures, {output.stat().st_size / 1e6:.1f} MB")
    if figures is not None:
        say(f"{figures}: {2 * len(page.pictures)} files")


def compare(
    first: Profile,
    second: Annotated[Path | None, argument("Another profile (.npz).", show_default="the first")] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("compare.html"),
    one: Annotated[
        str | None, option("STYLE/WB of the first profile; unless given, the first in it.", "--from")
    ] = None,
    other: Annotated[str | None, option("STYLE/WB of the second; unless given, the first in it.", "--to")] = None,
) -> None:
    """Show what two cameras, or two styles of one, make of the same light: a chart, ΔE00."""
    from lutforge.pipeline.reports import compare as write_comparison

    with progress_bar("comparing") as progress:
        page = write_comparison(first, second or first, output, one, other, progress)
    say(f"{output}: {page.title}")
    say(*page.lead)
