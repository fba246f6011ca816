"""`lutforge compare`: two cameras, or two styles of one, side by side on a page."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import Profile, progress_bar, say


def compare(
    first: Profile,
    second: Annotated[Path | None, typer.Argument(help="Another profile (.npz).", show_default="the first")] = None,
    output: Annotated[Path, typer.Option("-o", "--output", help="The page to write (.html).")] = Path("compare.html"),
    one: Annotated[
        str | None, typer.Option("--from", help="STYLE/WB of the first profile; unless given, the first in it.")
    ] = None,
    other: Annotated[
        str | None, typer.Option("--to", help="STYLE/WB of the second; unless given, the first in it.")
    ] = None,
) -> None:
    """Show what two cameras, or two styles of one, make of the same light: a chart, a picture, ΔE00."""
    from lutforge.pipeline.reports import compare as write_comparison

    with progress_bar("comparing") as progress:
        page = write_comparison(first, second or first, output, one, other, progress)
    say(f"{output}: {page.title}")
    for line in page.lead:
        say(line)
