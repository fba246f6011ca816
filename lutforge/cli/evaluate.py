"""`lutforge evaluate`: the thesis's error tables of a profile, held out by shot."""

import json
import sys
from typing import TYPE_CHECKING, Annotated

import typer

from lutforge.cli.console import AsJson, Profile, Sources, note, print_table, progress_bar
from lutforge.cli.sample import tell

if TYPE_CHECKING:
    from lutforge.evaluation.evaluation import Evaluation

TITLES = {"render": "RAW → JPEG", "linearize": "JPEG → RAW (white-balanced)"}


def evaluate(
    profile: Profile,
    sources: Sources,
    tables: Annotated[
        bool,
        typer.Option(
            "--tables",
            help="All methods of the thesis's tables, with times: radial basis functions, uniform and nonuniform "
            "lattices of 13, 17 and 24 nodes. Takes a minute or more.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Print the errors of a profile on samples, beside plain baselines.

    A shot that the profile was calibrated from is left out and predicted by a refit without it; any other is predicted
    by the profile as it is. Printed are the error of both directions, the RMSE of RAW, the linearization error over
    exposure pairs, and the error of refinishing between settings of one scene, where the shots show these.
    """
    from lutforge.model.camera_profile import as_profile
    from lutforge.pipeline.evaluation import evaluate as measure
    from lutforge.pipeline.raw_substitutes import raw_substitute_of
    from lutforge.pipeline.sampling import gather_samples

    camera = as_profile(profile)
    with progress_bar("sampling") as progress:
        told = (lambda sampled: None) if as_json else tell
        samples = gather_samples(sources, progress, told, raw_substitute_of(camera)).samples
    with progress_bar("evaluating") as progress:
        evaluation = measure(camera, samples, progress, tables=tables)
    for text in evaluation.notes:
        note(text)
    if as_json:
        json.dump(evaluation.as_json(), sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        sys.stdout.write("\n")
        return
    _print_errors(evaluation)
    _print_raw(evaluation)
    _print_linearization(evaluation)
    _print_refinish(evaluation)
    _print_shares(evaluation)


def _print_errors(evaluation: "Evaluation") -> None:
    from lutforge.evaluation.errors_table import FIGURES

    times = ("fit, s", "s/Mpixel") if evaluation.tables else ()
    for direction, title in TITLES.items():
        cells = []
        for row in evaluation.rows:
            if row.direction == direction:
                seconds = (row.fit_seconds, row.seconds_per_megapixel) if evaluation.tables else ()
                taken = tuple("–" if value is None else f"{value:.3g}" for value in seconds)
                cells.append((row.style, row.shot, row.method, _yes(row.held_out), *row.figures.cells, *taken))
        if cells:
            header = ("style", "shot", "method", "held out", *FIGURES, *times)
            print_table(f"{title}: error (1 = full scale)", header, cells)


def _print_raw(evaluation: "Evaluation") -> None:
    cells = [
        (row.style, row.method, _yes(row.held_out), str(row.count), *(f"{v:.4f}" for v in (row.rmse, *row.rmse_rgb)))
        for row in evaluation.raw
    ]
    if cells:
        header = ("style", "method", "held out", "n", "RMSE", "R", "G", "B")
        print_table("JPEG → RAW before white balance: RMSE (1 = saturation)", header, cells)


def _print_linearization(evaluation: "Evaluation") -> None:
    cells = [
        (row.style, row.method, _yes(row.held_out), str(row.pairs), *(f"{value:.4f}" for value in row.delta))
        for row in evaluation.linearization
    ]
    if cells:
        header = ("style", "method", "held out", "n", "R", "G", "B")
        print_table("Linearization error over pairs of exposures of one scene (1 = full scale)", header, cells)


def _print_refinish(evaluation: "Evaluation") -> None:
    from lutforge.evaluation.errors_table import FIGURES

    cells = [
        (row.source, row.target, row.method, _yes(row.held_out), str(row.shots), *row.figures.cells)
        for row in evaluation.refinish
    ]
    if cells:
        header = ("from", "to", "method", "held out", "pairs", *FIGURES)
        print_table("Refinish between settings of one scene: error (1 = full scale)", header, cells)


def _print_shares(evaluation: "Evaluation") -> None:
    from lutforge.evaluation.error_shares import SHARES

    if evaluation.shares:
        title = "Where the error of rendered colours comes from: RMSE (1 = full scale); squares add up"
        print_table(title, SHARES, [row.cells for row in evaluation.shares])


def _yes(value: bool) -> str:
    return "yes" if value else "no"
