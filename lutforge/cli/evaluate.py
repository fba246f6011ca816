"""`lutforge evaluate`: the error table of a profile, held out by shot."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from lutforge.cli.calibrate import Sources
from lutforge.cli.console import note, print_table, progress_bar
from lutforge.cli.sample import tell


def evaluate(
    profile: Annotated[Path, typer.Argument(help="The profile (.npz).", show_default=False)],
    sources: Sources,
    as_json: Annotated[bool, typer.Option("--json", help="Print the rows as JSON, for programs.")] = False,
) -> None:
    """Print the errors of a profile on samples, beside plain baselines.

    A shot that the profile was calibrated from is left out and predicted by a refit without it; any other is predicted
    by the profile as it is.
    """
    from lutforge.model.profile_file import load_profile
    from lutforge.pipeline import evaluate as measure
    from lutforge.pipeline import gather_samples

    camera = load_profile(profile)
    with progress_bar("sampling") as report:
        sampled = gather_samples(sources, report)
    if not as_json:
        tell(sampled)
    with progress_bar("evaluating") as report:
        evaluation = measure(camera, sampled.samples, report)
    for text in evaluation.notes:
        note(text)
    if as_json:
        rows = [row.as_json() for row in evaluation.rows]
        deltas = [entry.as_json() for entry in evaluation.linearisation]
        document = {"camera": camera.camera, "rows": rows, "linearisation": deltas, "notes": list(evaluation.notes)}
        json.dump(document, sys.stdout, indent=1)
        sys.stdout.write("\n")
        return
    header = (
        "style",
        "shot",
        "method",
        "held out",
        "n",
        "mean",
        "max",
        "Q1",
        "median",
        "Q3",
        "RMSE",
        "ΔE00",
        "max ΔE00",
    )
    for direction, title in (("render", "RAW → JPEG"), ("linearize", "JPEG → RAW (white-balanced)")):
        cells = []
        for row in evaluation.rows:
            if row.direction != direction:
                continue
            f = row.figures
            numbers = (f.mean, f.maximum, f.q1, f.median, f.q3, f.rmse)
            cells.append(
                (
                    row.style,
                    row.shot,
                    row.method,
                    "yes" if row.held_out else "no",
                    str(f.count),
                    *(f"{value:.4f}" for value in numbers),
                    "–" if f.de00_mean is None else f"{f.de00_mean:.2f}",
                    "–" if f.de00_max is None else f"{f.de00_max:.2f}",
                )
            )
        print_table(f"{title}: error (1 = full scale)", header, cells)
    if evaluation.linearisation:
        lines = [
            (entry.style, entry.method, str(entry.pairs), *(f"{value:.4f}" for value in entry.delta))
            for entry in evaluation.linearisation
        ]
        print_table("Linearisation error δ over exposure pairs (4.11)", ("style", "method", "n", "R", "G", "B"), lines)
