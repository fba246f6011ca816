"""The commands that measure and compare profiles: evaluate, report and compare."""

import json
import sys
from pathlib import Path
from typing import Annotated

import lutforge as lf
from lutforge.cli.console import Profile, argument, note, option, print_tables, progress_bar, say
from lutforge.cli.sampling import print_shots
from lutforge.reports.tables import TITLES, error_table, more_tables


def evaluate(
    profile: Profile,
    sources: Annotated[list[Path], argument("Sample tables (.csv, .npz), RAW files, folders of RAW files.")],
    tables: Annotated[
        bool,
        option(
            "All methods of the thesis's tables, with times: radial basis functions, uniform and nonuniform "
            "lattices of 13, 17 and 24 nodes. Takes a minute or more.",
            "--tables",
        ),
    ] = False,
    as_json: Annotated[bool, option("Print everything as JSON, for programs.", "--json")] = False,
) -> None:
    """Print the errors of a profile on samples, beside plain baselines.

    A shot that the profile was calibrated from is left out and predicted by a refit without it; any other is predicted
    by the profile as it is. Printed are the error of both directions, the RMSE of RAW, the linearization error over
    exposure pairs, and the error of refinishing between settings of one scene, where the shots show these.
    """
    from lutforge.pipeline.sampling import gather_samples

    camera = lf.load_profile(profile)
    with progress_bar("sampling") as progress:
        sampled = gather_samples(sources, progress)
    if not as_json:
        print_shots(sampled)
    with progress_bar("evaluating") as progress:
        evaluation = lf.evaluate(camera, sampled.samples, progress, tables=tables)
    note(*evaluation.notes)
    if as_json:
        json.dump(evaluation.as_json(), sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        sys.stdout.write("\n")
        return
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction]
        print_tables(error_table(f"{title}: error (1 = full scale)", rows))
    print_tables(*more_tables(evaluation))


def report(
    profile: Profile,
    sources: Annotated[
        list[Path] | None, argument("What it was calibrated from: sample tables, RAW files, folders.")
    ] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("report.html"),
) -> None:
    """Write a report that needs no network: curves, maps and tables of a profile.

    With samples, the errors held out by shot and what to shoot next; with RAW files, error maps of real shots too.
    """
    from lutforge.pipeline.reports import check_report_output
    from lutforge.pipeline.sampling import gather_samples

    check_report_output(output, [profile, *(sources or [])])
    camera = lf.load_profile(profile)
    sampled = None
    if sources:
        with progress_bar("sampling") as progress:
            sampled = gather_samples(sources, progress)
        print_shots(sampled)
    with progress_bar("reporting") as progress:
        page = lf.report(camera, sampled, output, progress)
    say(f"{output}: {len(page.pictures)} figures, {output.stat().st_size / 1e6:.1f} MB")


def compare(
    first: Profile,
    second: Annotated[Path | None, argument("Another profile (.npz).", show_default="the first")] = None,
    output: Annotated[Path, option("The page to write (.html).", "-o", "--output")] = Path("compare.html"),
    first_setting: Annotated[
        str | None, option("STYLE/WB of the first profile; unless given, the first in it.", "--from")
    ] = None,
    second_setting: Annotated[
        str | None, option("STYLE/WB of the second; unless given, the first in it.", "--to")
    ] = None,
) -> None:
    """Show what two cameras, or two styles of one, make of the same light: a chart, ΔE00."""
    from lutforge.pipeline.reports import compare as write_comparison

    with progress_bar("comparing") as progress:
        page = write_comparison(first, second or first, output, first_setting, second_setting, progress)
    say(f"{output}: {page.title}")
    say(*page.lead)
