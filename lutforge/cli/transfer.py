"""`lutforge transfer`: one camera's RAW → another's, from photographs of the same scenes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lutforge.cli.console import argument, note, option, progress_bar, say
from lutforge.errors import SettingsError

if TYPE_CHECKING:
    from lutforge.calibration.physical.raw_to_raw import Form

NAMES = {"matrix": "one matrix", "piecewise": "piecewise linear in hue", "root-polynomial": "root polynomial"}


def transfer(
    source: Annotated[Path, argument("The first camera's samples, RAW file or folder.")],
    target: Annotated[Path, argument("The other camera's, of the same charts.")],
    output: Annotated[Path, option("The transfer to write (.json).", "-o", "--output")],
    piecewise: Annotated[bool, option("Piecewise linear in hue: nearer than one matrix.", "--piecewise")] = False,
    root_polynomial: Annotated[
        bool, option("Six terms, with √rg, √gb, √rb: mostly nearer still.", "--root-polynomial")
    ] = False,
) -> None:
    """Fit RAW → RAW between two cameras from charts that both photographed, for apply --as and bake match."""
    from lutforge.pipeline.calibration import write_transfer

    if piecewise and root_polynomial:
        raise SettingsError("--piecewise and --root-polynomial are two forms; choose one")
    form: Form = "piecewise" if piecewise else "root-polynomial" if root_polynomial else "matrix"
    with progress_bar("sampling") as progress:
        common, fitted = write_transfer(source, target, output, form, progress, lambda sampled: note(*sampled.left_out))
    say(f"{output}: {fitted[form].source} to {fitted[form].target}, from {common} common colours: {NAMES[form]}")
    known = {form: transfer.error for form, transfer in fitted.items() if transfer.error is not None}
    if known:
        errors = ", ".join(f"{NAMES[form]} {error:.2%}" for form, error in known.items())
        say(f"  held-out error, relative: {errors}")
