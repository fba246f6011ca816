"""`lutforge transfer`: one camera's RAW → another's, from photographs of the same scenes."""

from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.console import note, progress_bar, say
from lutforge.errors import CalibrationError, SampleError, SettingsError

WORST = 0.3
"""Held-out relative error beyond which the two cameras did not see the same colours."""


def transfer(
    source: Annotated[Path, typer.Argument(help="The first camera's samples, RAW file or folder.", show_default=False)],
    target: Annotated[Path, typer.Argument(help="The other camera's, of the same charts.", show_default=False)],
    output: Annotated[Path, typer.Option("-o", "--output", help="The transfer to write (.json).")],
    piecewise: Annotated[
        bool, typer.Option("--piecewise", help="Piecewise linear in hue: nearer than one matrix.")
    ] = False,
    root_polynomial: Annotated[
        bool, typer.Option("--root-polynomial", help="Six terms, with √rg, √gb, √rb: mostly nearer still.")
    ] = False,
) -> None:
    """Fit RAW → RAW between two cameras from charts that both photographed, for apply --as and bake match."""
    from lutforge.calibration.physical.raw_to_raw import Form, fit_raw_transfer, pair_samples
    from lutforge.pipeline.outputs import check_output
    from lutforge.pipeline.sampling import gather_samples

    check_output(output, (".json",), (source, target))
    if piecewise and root_polynomial:
        raise SettingsError("--piecewise and --root-polynomial are two forms; choose one")
    sets = []
    for path in (source, target):
        with progress_bar(f"sampling {path.name}") as report:
            sampled = gather_samples([path], report)
        for text in sampled.left_out:
            note(text)
        if len(set(sampled.samples.camera.tolist())) != 1:
            raise SampleError(f"{path}: samples of several cameras; give those of one")
        sets.append(sampled.samples)
    first, second = sets
    names = (str(first.camera[0]), str(second.camera[0]))
    x, y, neutral = pair_samples(first, second)
    forms: dict[Form, str] = {
        "matrix": "one matrix",
        "piecewise": "piecewise linear in hue",
        "root-polynomial": "root polynomial",
    }
    fitted = {form: fit_raw_transfer(*names, x, y, neutral, form) for form in forms}
    chosen: Form = "piecewise" if piecewise else "root-polynomial" if root_polynomial else "matrix"
    error = fitted[chosen].error
    if error is not None and error > WORST:
        raise CalibrationError(
            f"{len(x)} colours that should be common differ by {error:.0%} after the best transfer: the "
            "shots are not of the same scenes; photograph the same charts with both cameras"
        )
    fitted[chosen].save(output)
    say(f"{output}: {names[0]} to {names[1]}, from {len(x)} common colours: {forms[chosen]}")
    errors = ", ".join(f"{name} {fitted[form].error:.2%}" for form, name in forms.items())
    say(f"  held-out error, relative: {errors}")
