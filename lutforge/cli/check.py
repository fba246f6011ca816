"""`lutforge check`: what is in a LUT file, who can read it, what will go wrong."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import err, say
from lutforge.errors import LutError


def check(
    luts: Annotated[list[Path], typer.Argument(help="LUT files of any origin.", show_default=False)],
) -> None:
    """Show what LUT files hold, which programs read them, and which misread them."""
    from lutforge.luts.check import check_lut, report_lines

    failed = 0
    for path in luts:
        try:
            for line in report_lines(check_lut(path)):
                say(line)
        except LutError as error:
            failed += 1
            if len(luts) == 1:
                raise
            err.print(f"lutforge: {error}", markup=False)
    if failed:
        raise typer.Exit(2)
