"""`lutforge transfer`: one camera's RAW → another's, from photographs of the same scenes."""

from pathlib import Path
from typing import Annotated

from lutforge.cli.console import argument, note, option, progress_bar, say


def transfer(
    source: Annotated[Path, argument("The first camera's samples, RAW file or folder.")],
    target: Annotated[Path, argument("The other camera's, of the same charts.")],
    output: Annotated[Path, option("The transfer to write (.json).", "-o", "--output")],
) -> None:
    """Fit RAW → RAW between two cameras from charts that both photographed, for apply --as and bake match."""
    from lutforge.pipeline.calibration import write_transfer

    with progress_bar("sampling") as progress:
        common, fitted, of_matrix = write_transfer(
            source, target, output, progress, lambda sampled: note(*sampled.left_out)
        )
    say(f"{output}: {fitted.source} to {fitted.target}, from {common} common colours: a root polynomial")
    say(f"  held-out error, relative: {fitted.error:.2%}; of one matrix {of_matrix:.2%}")
