"""`lutforge evaluate`: the thesis's error tables of a profile, held out by shot."""

import json
import sys
from typing import Annotated

from lutforge.cli.console import AsJson, Profile, Sources, note, option, print_tables, progress_bar
from lutforge.cli.sample import tell
from lutforge.report.tables import TITLES, error_table, more_tables


def evaluate(
    profile: Profile,
    sources: Sources,
    tables: Annotated[
        bool,
        option(
            "All methods of the thesis's tables, with times: radial basis functions, uniform and nonuniform "
            "lattices of 13, 17 and 24 nodes. Takes a minute or more.",
            "--tables",
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
    from lutforge.pipeline.sampling import gather_samples

    camera = as_profile(profile)
    with progress_bar("sampling") as progress:
        sampled = gather_samples(sources, progress)
    if not as_json:
        tell(sampled)
    with progress_bar("evaluating") as progress:
        evaluation = measure(camera, sampled.samples, progress, tables=tables)
    note(*evaluation.notes)
    if as_json:
        json.dump(evaluation.as_json(), sys.stdout, indent=1, ensure_ascii=False, allow_nan=False)
        sys.stdout.write("\n")
        return
    for direction, title in TITLES.items():
        rows = [row for row in evaluation.rows if row.direction == direction]
        print_tables(error_table(f"{title}: error (1 = full scale)", rows))
    print_tables(*more_tables(evaluation))
