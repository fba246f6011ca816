"""`lutforge check`: what is in a LUT file or camera profile, who can read it, what will go wrong."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import argument, for_each, say


def check(
    luts: Annotated[list[Path], argument("LUT files of any origin.")],
) -> None:
    """Show what LUT files hold, which programs read them, and which misread them."""
    for_each("checking", luts, _show)


def _show(path: Path) -> None:
    from lutforge.pipeline.inspection import check as lines_of

    say(*lines_of(path))
