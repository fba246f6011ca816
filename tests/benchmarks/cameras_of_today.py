"""What cameras of today do beyond a fixed rendering: how well it is found, and what it costs on unseen shots.

    python -m tests.benchmarks.cameras_of_today [--only WORD …] [--data FOLDER]

Prints a table: the figure, its target, and beside it the figure of LutForge 0.2.0 before it modelled any of this.
Errors are mean norms of the RGB difference of rendered colours, 1 = full scale, of shots that the calibration had not
seen, divided by the same without falloff, gain or tone. FOLDER (or LUTFORGE_TEST_DATA) has the shots of the Canon S40;
rows that need them are left out without. Lattices have 17 nodes per axis.
"""

import argparse
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.samples.sample_set import SampleSet
from lutforge.simulate.camera import nikon_d5100
from tests.calibration.samples_of_today import lost_stops, spread_over_picture, with_bright_jpegs, with_dark_corners
from tests.calibration.samples_simulated import chart_140, photograph_patches, surfaces

OPTIONS = CalibrationOptions(size=17)
BEFORE: dict[str, float] = {}
"""Figures of the code before, by row."""


@dataclass(frozen=True)
class Row:
    """A line of the table; target: what the value may be at most."""

    name: str
    value: float
    target: float


Rows = Iterator[Row]


def unseen_error(samples: SampleSet, *, unseen: SampleSet | None = None) -> float:
    """The mean error on shots that are not calibrated from: the unseen ones, else each shot of the samples in turn."""
    if unseen is not None:
        return _error(samples, unseen)
    names = np.unique(samples.shot)
    errors = [_error(samples.select(samples.shot != name), samples.select(samples.shot == name)) for name in names]
    return float(np.average(errors, weights=[np.count_nonzero(samples.shot == name) for name in names]))


def _error(seen: SampleSet, unseen: SampleSet) -> float:
    rows = lf.evaluate(lf.calibrate(seen, OPTIONS), unseen).rows
    return next(
        row.figures.mean for row in rows if (row.direction, row.shot, row.method) == ("render", "all", "lattice")
    )


def found_stops(profile: lf.CameraProfile, samples: SampleSet) -> Array:
    """What the profile takes the falloff at the places of samples for, (n,); nothing where it has none."""
    from lutforge.calibration.shots.falloff import at_the_centre

    return np.asarray(np.log2(at_the_centre(samples, profile.falloffs).raw[:, 1] / samples.raw[:, 1]))


@cache
def s40(folder: Path) -> SampleSet:
    """The samples of five photographs by a Canon PowerShot S40."""
    return lf.sample([folder / "canon_powershot_s40"])


def s40_falloff(folder: Path) -> Rows:
    """Corrected falloffs of the S40: RAW darkened, or JPEGs brightened through the camera's own rendering."""
    samples = s40(folder)
    profile = lf.calibrate(samples, OPTIONS)
    clean = unseen_error(samples)
    yield Row("S40 as it is: falloffs found", float(len(profile.falloffs)), 0)
    shots = np.unique(samples.shot)
    lens = np.where(np.isin(samples.shot, shots[::2]), "one", "other")
    for ev, centre in ((0.3, (0.0, 0.0)), (0.85, (0.0, 0.0)), (1.5, (0.0, 0.0)), (0.85, (0.06, -0.05))):
        stops = lost_stops(samples, ev, centre)
        what = f"S40, {ev:g} EV{', off-centre' if any(centre) else ''}"
        for way, spoilt in (
            ("dark RAW", with_dark_corners(samples, stops)),
            ("bright JPEG", with_bright_jpegs(samples, stops, profile)),
        ):
            found = found_stops(lf.calibrate(spoilt, OPTIONS), samples)
            yield Row(f"{what}, {way}: falloff off by at most, EV", float(np.abs(found - stops).max()), 0.05)
            yield Row(f"{what}, {way}: error ratio", unseen_error(spoilt) / clean, 1.15)
    stops = np.where(lens == "one", lost_stops(samples, 1.2), lost_stops(samples, 0.5))
    two = with_dark_corners(replace(samples, lens=lens), stops)
    found = found_stops(lf.calibrate(two, OPTIONS), two)
    yield Row("S40, two lenses, 1.2 and 0.5 EV: off by at most, EV", float(np.abs(found - stops).max()), 0.05)
    yield Row("S40, two lenses, 1.2 and 0.5 EV: error ratio", unseen_error(two) / clean, 1.15)


def photographed(patches: Array, seed: int, **options: object) -> SampleSet:
    """Surfaces by the simulated camera, at places drawn over the picture."""
    samples = photograph_patches(nikon_d5100(), patches, stops=(-3, -2, -1, 0), seed=seed, **options)  # type: ignore[arg-type]
    return spread_over_picture(samples, seed)


def simulated_falloff() -> Rows:
    """Corrected falloffs of the simulated camera, of two shapes."""
    seen, unseen = photographed(chart_140(), 1), photographed(surfaces(200, 99), 2)
    clean = unseen_error(seen, unseen=unseen)
    yield Row("simulated, none: falloffs found", float(len(lf.calibrate(seen, OPTIONS).falloffs)), 0)
    for ev, power in ((0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (1.0, 2.0)):
        spoilt = [with_dark_corners(each, lost_stops(each, ev, power=power)) for each in (seen, unseen)]
        what = f"simulated, {ev:g} EV, r^{2 * power:g}"
        found = found_stops(lf.calibrate(spoilt[0], OPTIONS), spoilt[0])
        yield Row(
            f"{what}: falloff off by at most, EV", float(np.abs(found - lost_stops(seen, ev, power=power)).max()), 0.05
        )
        yield Row(f"{what}: error ratio", unseen_error(spoilt[0], unseen=spoilt[1]) / clean, 1.3)


def false_falloffs() -> Rows:
    """Draws of a few shots without falloff: how often one is reported."""
    found = []
    for seed in range(60):
        rng = np.random.default_rng([seed, 11])
        balances = tuple(rng.permutation(("tungsten", "daylight", "cloudy", "shade"))[: rng.integers(1, 4)])
        patches = surfaces(int(rng.integers(24, 120)), seed)
        samples = photograph_patches(nikon_d5100(), patches, balances=balances, stops=(-2, -1, 0), seed=seed)
        samples = spread_over_picture(samples, seed)
        if rng.integers(2):  # the same surfaces at the same places in all shots
            samples = replace(samples, position=samples.position[samples.patch.astype(int)])
        found.append(_has_falloff(samples))
    yield Row("simulated, 60 draws without falloff: share with one", float(np.mean(found)), 0.01)


def _has_falloff(samples: SampleSet) -> bool:
    from lutforge.calibration.shots.falloff import fit_falloffs
    from lutforge.calibration.style_data import unclipped

    return bool(fit_falloffs(samples, samples.wb, unclipped(samples, samples.wb)))


def parts(folder: Path | None) -> dict[str, Callable[[], Rows]]:
    """What is measured, by name."""
    made: dict[str, Callable[[], Rows]] = {"simulated_falloff": simulated_falloff, "false_falloffs": false_falloffs}
    if folder is None:
        return made
    return {"s40_falloff": lambda: s40_falloff(folder), **made}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the parts whose names hold a word")
    parser.add_argument("--data", type=Path, default=os.environ.get("LUTFORGE_TEST_DATA"))
    arguments = parser.parse_args()
    print(f"{'':64s}{'value':>9s}{'target':>9s}{'before':>9s}")
    for name, measure in parts(Path(arguments.data) if arguments.data else None).items():
        if arguments.only and not any(word in name for word in arguments.only):
            continue
        for row in measure():
            before = f"{BEFORE[row.name]:9.3f}" if row.name in BEFORE else f"{'–':>9s}"
            missed = "  MISSED" if row.value > row.target else ""
            print(f"{row.name:64s}{row.value:9.3f}{row.target:9.3f}{before}{missed}", flush=True)


if __name__ == "__main__":
    main()
