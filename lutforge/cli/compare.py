"""`lutforge compare`: two cameras, or two styles of one, side by side on a page."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import Profile, argument, option, progress_bar, say


def compare(
    first: Profile,
    second: Annotated[Path | None, argument("Another profile (.npz).", show_default="the first")] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("compare.html"),
    one: Annotated[
        str | None, option("STYLE/WB of the first profile; unless given, the first in it.", "--from")
    ] = None,
    other: Annotated[str | None, option("STYLE/WB of the second; unless given, the first in it.", "--to")] = None,
) -> None:
    """Show what two cameras, or two styles of one, make of the same light: a chart, a picture, ΔE00."""
    from lutforge.pipeline.reports import compare as write_comparison

    with progress_bar("comparing") as progress:
        page = write_comparison(first, second or first, output, one, other, progress)
    say(f"{output}: {page.title}")
    say(*page.lead)
