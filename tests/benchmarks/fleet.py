"""How right the estimator is on a fleet of cameras whose truth is known: what a change of it is judged by.

    LUTFORGE_TEST_DATA=DIR python -m tests.benchmarks.fleet [--half choose|report] [--only NAME …] [--json FILE]
        [--compare FILE] [--tables FILE …]

Each camera is calibrated from samples like a person's, and asked for colours of other reflectances, lights and
exposures. A change is chosen on the cameras of the first half, and lands with the figures of both. Printed are all
figures of each camera, lower is better, then a table of each half, the worst camera first. `--compare` prints the
ratio to an earlier `--json`. `--tables` measures nothing: it prints the tables of the guide, in Markdown, from earlier
`--json` files, the oldest first. LUTFORGE_TEST_DATA names the folder of real data; without it nothing is measured.

`tests.benchmarks.fleet_figures` says what the figures are.
"""

import json
import os
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from functools import partial
from itertools import product
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from tests.benchmarks import common
from tests.benchmarks.common import Figure, Figures, heading, row
from tests.benchmarks.fleet_cameras import FleetCamera, Half, fleet
from tests.benchmarks.fleet_figures import matched, measure

WORKERS = 2

COLUMNS: Mapping[str, str] = {
    "render: ΔE00 mean": "render", "render: ΔE00 95 %": "95 %", "render: ΔE00 99.9 %": "99.9 %",
    "render: ΔE00 max": "max", "render, kriging: ΔE00 mean": "kriging", "render, bright: ΔE00 mean": "bright",
    "render, saturated: ΔE00 mean": "saturated", "file CLF 17³, render: ΔE00 mean": "CLF 17³",
    "file CLF 33³, render: ΔE00 mean": "CLF 33³", "file plain 33³, refinish of styles: ΔE00 mean": "plain 33³",
    "config's view: ΔE00 mean": "view", "config's look of styles: ΔE00 mean": "look", "ICC, render: ΔE00 mean": "ICC",
    "linearize: RMSE": "linearize", "linearize, kriging: RMSE": "kriging", "linearize: ΔE00 mean": "its ΔE00",
    "refinish: RMSE median pair": "refinish", "refinish: RMSE worst pair": "worst pair",
    "refinish, bare: RMSE worst pair": "bare", "refinish / bare, least code < 200": "/ bare < 200",
    "refinish to white: codes per code": "to white", "refinish to white, truth: codes per code": "truth's",
    "neutral light: codes off neutral": "neutral",
    "more light: codes darker": "darker", "round trip: codes, 99.9 %": "trip",
    "render: held-out error / true": "held-out / true", "linearize: held-out error / true": "linearize",
    "next shots: known error / asked-for error": "known / asked for",
    "match with the next camera: ΔE00 mean": "match", "vignetting: off by, EV": "vignetting",
    "distortion: off by, RAW pixels": "distortion", "calibration: CPU seconds": "seconds",
}  # fmt: skip
"""Figures of the tables, and the heads of their columns."""
GUIDE: tuple[str, ...] = (
    "render: ΔE00 mean", "render: ΔE00 95 %", "render: ΔE00 99.9 %", "render, kriging: ΔE00 mean",
    "render, bright: ΔE00 mean", "render, saturated: ΔE00 mean", "file CLF 17³, render: ΔE00 mean",
    "file CLF 33³, render: ΔE00 mean", "file plain 33³, refinish of styles: ΔE00 mean",
    "file plain 65³, refinish of styles: ΔE00 mean", "config's view: ΔE00 mean",
    "config's look of styles: ΔE00 mean", "ICC, render: ΔE00 mean", "linearize: RMSE", "linearize, kriging: RMSE",
    "linearize, bright: RMSE", "refinish: RMSE median pair", "refinish: RMSE worst pair",
    "refinish, bare: RMSE worst pair", "refinish / bare, least code < 200", "refinish to white: codes per code",
    "refinish to white, truth: codes per code",
    "match with the next camera: ΔE00 mean", "neutral light: codes off neutral", "more light: codes darker",
    "round trip: codes, 99.9 %", "render: held-out error / true", "linearize: held-out error / true",
    "render: held-out error / that of unseen samples", "linearize: held-out error / that of unseen samples",
    "render: expected error / true, surest quarter", "render: expected error / true, least sure quarter",
    "next shots: known error / asked-for error",
    "vignetting: off by, EV", "distortion, truth: RAW pixels", "distortion: off by, RAW pixels",
)  # fmt: skip
"""Rows of the guide's table, per half as median (worst) of the cameras."""

Measured = dict[str, float]
HALVES: tuple[Half, ...] = ("choose", "report")


def as_figures(
    camera: FleetCamera, results: Mapping[str, "Future[Measured]"], folder: Path, done: dict[str, Measured]
) -> Figures:
    """The figures of a camera when they are measured, with its match to the next one of its half."""
    values = results[camera.name].result()
    done[camera.name] = values
    for name, value in values.items():
        yield Figure(f"{camera.name}, {name}", value, compared=is_error(name))


def is_error(name: str) -> bool:
    """Whether a figure is an error of the estimator: no time, no ratio to a true error, no figure of another method."""
    return not any(word in name for word in ("seconds", "/ t", "truth", "kriging"))


def table(half: Half, rows: Mapping[str, Measured]) -> None:
    """Print a half: the worst rendering first, then medians."""
    heading(f"{half}: {len(rows)} cameras", *COLUMNS.values())
    first = next(iter(COLUMNS))
    for name, values in sorted(rows.items(), key=lambda entry: -entry[1].get(first, 0.0)):
        print_row(name, values)
    medians = {name: float(np.median([v[name] for v in rows.values() if name in v] or [np.nan])) for name in COLUMNS}
    print_row("median", medians)


def print_row(name: str, values: Measured) -> None:
    """Print a row of a table with three significant digits."""
    row(name, *(f"{values[column]:.3g}" if np.isfinite(values.get(column, np.nan)) else "–" for column in COLUMNS))


def guide_tables(files: Sequence[Path], cameras: Sequence[FleetCamera]) -> None:
    """Print the tables of the guide: of each half the median (worst) camera, a column for each file."""
    runs = [of_halves(json.loads(file.read_text(encoding="utf-8")), cameras) for file in files]
    heading("", *(f"{half}, {file.stem}" for half in HALVES for file in files))
    for name in GUIDE:
        row(name, *(_cell(run, half, name) for half in HALVES for run in runs))


def _cell(run: Measured, half: Half, name: str) -> str:
    median, worst = (run.get(f"fleet, {half}, {name}: {which}", np.nan) for which in ("median", "worst"))
    return f"{median:.3g} ({worst:.3g})" if np.isfinite(median) else "–"


def of_halves(run: Measured, cameras: Sequence[FleetCamera]) -> Measured:
    """The rows of the guide's table: of each half the median camera and the worst, from the figures of a run."""
    rows = {}
    for half, name in product(HALVES, GUIDE):
        values = [run.get(f"{each.name}, {name}", np.nan) for each in cameras if each.half == half]
        known = np.array([value for value in values if np.isfinite(value)])
        if not len(known):
            continue
        farthest = np.argmax(np.abs(np.log(np.maximum(known, 1e-9))))
        rows[f"fleet, {half}, {name}: median"] = float(np.median(known))
        rows[f"fleet, {half}, {name}: worst"] = float(known[farthest] if "/ t" in name else known.max())
    return rows


def main() -> int:
    """Measure the cameras on both cores, and print their figures and tables."""
    parser = common.parser(__doc__)
    parser.add_argument("--half", choices=("choose", "report"), help="the cameras of one half")
    parser.add_argument("--tables", nargs="+", type=Path, default=[], metavar="FILE", help="print the guide's tables")
    arguments = parser.parse_args()
    data = common.real_data()
    if data is None:
        return 0
    cameras = fleet(data)
    if arguments.tables:
        guide_tables(arguments.tables, cameras)
        return 0
    taken = [
        each for each in cameras if arguments.half in (None, each.half) and common.chosen(each.name, arguments.only)
    ]
    os.environ |= dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), "1")  # of the processes to come
    done: dict[str, Measured] = {}
    with tempfile.TemporaryDirectory() as work, ProcessPoolExecutor(WORKERS, get_context("spawn")) as pool:
        folder = Path(work)
        results = {each.name: pool.submit(measure, each, folder) for each in taken}

        def match_figures(camera: FleetCamera, other: FleetCamera) -> Figures:
            for name, value in matched(camera, other, folder).items():
                done[camera.name][name] = value
                yield Figure(f"{camera.name}, {name}", value)

        def parts(_: Path) -> common.Parts:
            made = {each.name: partial(as_figures, each, results, folder, done) for each in taken}
            for half in ("choose", "report"):
                own = [each for each in taken if each.half == half]
                for camera, other in zip(own, [*own[1:], *own[:1]], strict=True):
                    if camera is not other:
                        made[f"{camera.name} to {other.name}"] = partial(match_figures, camera, other)
            return made

        status = common.measured(parts, arguments)
    if arguments.json:
        run = json.loads(arguments.json.read_text(encoding="utf-8"))
        text = json.dumps(run | of_halves(run, cameras), indent=1, ensure_ascii=False)
        arguments.json.write_text(text + "\n", encoding="utf-8")
    for half in ("choose", "report"):
        rows = {each.name: done[each.name] for each in taken if each.half == half and each.name in done}
        if rows:
            table(half, rows)
    return status


if __name__ == "__main__":
    sys.exit(main())
