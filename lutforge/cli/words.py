"""Arguments that several commands share."""

from pathlib import Path
from typing import Annotated

import typer

Profile = Annotated[Path, typer.Argument(help="The profile (.npz).", show_default=False)]
Shots = Annotated[list[Path], typer.Argument(help="RAW files, or folders of them.", show_default=False)]
Sources = Annotated[
    list[Path],
    typer.Argument(help="Sample tables (.csv, .parquet), RAW files, folders of RAW files.", show_default=False),
]
ProfileOutput = Annotated[Path, typer.Option("-o", "--output", help="The profile to write (.npz).")]
AsJson = Annotated[bool, typer.Option("--json", help="Print everything as JSON, for programs.")]
