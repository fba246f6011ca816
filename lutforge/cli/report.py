"""`lutforge report`: a profile, its errors and what to shoot next, as one HTML file."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.atomic_write import require_writable
from lutforge.cli.console import progress_bar, say
from lutforge.cli.sample import tell


def report(
    profile: Annotated[Path, typer.Argument(help="The profile (.npz).", show_default=False)],
    sources: Annotated[
        list[Path] | None,
        typer.Argument(help="What it was calibrated from: sample tables, RAW files, folders.", show_default=False),
    ] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="The page to write.")] = Path("report.html"),
    figures: Annotated[
        Path | None, typer.Option(help="A folder for the figures, each as SVG and PNG.", show_default=False)
    ] = None,
) -> None:
    """Write a report that needs no network: curves, maps and tables of a profile.

    With samples, the errors held out by shot and what to shoot next; with RAW files, error maps of real shots too.
    """
    from lutforge.model.profile_file import load_profile
    from lutforge.pipeline import gather_samples
    from lutforge.pipeline import report as build
    from lutforge.report.page import write_figures, write_page

    require_writable(output)
    camera = load_profile(profile)
    sampled = None
    if sources:
        with progress_bar("sampling") as progress:
            sampled = gather_samples(sources, progress)
        tell(sampled)
    with progress_bar("reporting") as progress:
        page = build(camera, sampled, progress)
    write_page(page, output)
    say(f"{output}: {len(page.pictures)} figures, {output.stat().st_size / 1e6:.1f} MB")
    if figures is not None:
        written = write_figures(page, figures)
        say(f"{figures}: {len(written)} files")
