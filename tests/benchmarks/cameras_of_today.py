"""What cameras of today do beyond a fixed rendering: how well it is found, and what it costs on unseen shots.

    python -m tests.benchmarks.cameras_of_today [--only WORD …] [--data FOLDER] [--keep FOLDER]

Prints a table: the figure, its target, and beside it the figure of LutForge 0.2.0 before it modelled any of this.
Errors are mean norms of the RGB difference of rendered colours, 1 = full scale, of shots that the calibration had not
seen, divided by the same without falloff, gain or tone. FOLDER (or LUTFORGE_TEST_DATA) has the shots of the Canon S40;
rows that need them are left out without. Lattices have 17 nodes per axis.
"""

import argparse
import os
import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.shots.departures import departing_shots
from lutforge.calibration.shots.falloff import at_the_centre, fit_falloffs
from lutforge.calibration.style import unclipped
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from tests.benchmarks import pictures_of_today
from tests.benchmarks.accuracy import samples_of
from tests.benchmarks.rows_of_today import BEFORE, Row, Rows
from tests.cases.cameras import photographed as photographed_camera
from tests.cases.cameras import unseen_camera
from tests.cases.real_data import CHARTS, read_published_pairs
from tests.cases.samples import (
    BALANCES,
    chart_140,
    lost_stops,
    photograph_patches,
    shadow_stops,
    spread_over_picture,
    surfaces,
    with_bright_jpegs,
    with_dark_corners,
    with_gamma,
    with_scene_tone,
)

OPTIONS = CalibrationOptions(size=17)


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


def photographed(patches: Array, seed: int, name: str) -> SampleSet:
    """Surfaces by the simulated camera, at places drawn over the picture."""
    samples = photograph_patches(nikon_d5100(), patches, stops=(-3, -2, -1, 0), seed=seed)
    return spread_over_picture(replace(samples, shot=np.char.add(samples.shot, f" {name}")), seed)


def simulated_falloff() -> Rows:
    """Corrected falloffs of the simulated camera, of two shapes."""
    seen, unseen = photographed(chart_140(), 1, "seen"), photographed(surfaces(200, 99), 2, "unseen")
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
    return bool(fit_falloffs(samples, samples.wb, unclipped(samples, samples.wb)))


def simulated_gains() -> Rows:
    """Five settings, each of which the camera brings up by a gain of its own before it renders it."""
    gains = dict(zip(BALANCES, (0.9, 0.95, 1.0, 1.05, 1.1), strict=True))
    seen, unseen = photographed(chart_140(), 1, "seen"), photographed(surfaces(200, 99), 2, "unseen")
    clean = unseen_error(seen, unseen=unseen)
    seen, unseen = (_with_gains(each, gains) for each in (seen, unseen))
    balances = lf.calibrate(seen, OPTIONS).white_balances
    off = max(abs(balances[name].gain / gain - 1.0) for name, gain in gains.items())
    yield Row("simulated, gains 0.9 to 1.1: gain off by at most", off, 0.003)
    yield Row("simulated, gains 0.9 to 1.1: error ratio", unseen_error(seen, unseen=unseen) / clean, 1.05)


def _with_gains(samples: SampleSet, gains: dict[str, float]) -> SampleSet:
    factors = np.array([gains[str(name)] for name in samples.white_balance])
    return replace(samples, raw=samples.raw / factors[:, None])


def simulated_tone() -> Rows:
    """Tone of some of 15 shots by the simulated camera: a power of the codes, an exposure, lifted shadows."""
    seen, unseen = photographed(chart_140(), 1, "seen"), photographed(surfaces(200, 99), 2, "unseen")
    seen = seen.select(~np.char.endswith(seen.shot, "-3 seen"))
    names = [str(name) for name in np.unique(seen.shot)]
    brighter, shadows = np.full(len(seen), 0.3), shadow_stops(seen, 0.5)
    cases = {
        "power 0.93 of one": (names[4:5], with_gamma(seen, names[4:5], 0.93)),
        "+0.3 EV of one": (names[4:5], with_scene_tone(seen, names[4:5], brighter, nikon_d5100())),
        "shadows +0.5 EV of a third": (names[::3], with_scene_tone(seen, names[::3], shadows, nikon_d5100())),
    }
    for what, (shots, samples) in cases.items():
        yield from _tone_rows(f"simulated, {what}", samples, shots)
        clean = unseen_error(seen.select(~np.isin(seen.shot, shots)), unseen=unseen)
        yield Row(f"simulated, {what}: error ratio", unseen_error(samples, unseen=unseen) / clean, 1.1)


def _departing(samples: SampleSet) -> set[str]:
    multipliers = complete_multipliers(samples)[0]
    return {each.shot for each in departing_shots(samples, multipliers, unclipped(samples, multipliers))}


def _tone_rows(what: str, samples: SampleSet, shots: list[str]) -> Rows:
    found = _departing(samples)
    yield Row(f"{what}: not found", float(len(set(shots) - found)), 0)
    yield Row(f"{what}: others accused", float(len(found - set(shots))), 0)


def s40_tone(folder: Path) -> Rows:
    """A power of 0.85 of the codes of each of the S40's shots in turn; errors are of the four others."""
    samples = s40(folder)
    names = [str(name) for name in np.unique(samples.shot)]
    for name in names:
        yield from _tone_rows(f"S40, power 0.85 of {name}", with_gamma(samples, [name], 0.85), [name])
    for name in names[:2]:
        spoilt, errors = with_gamma(samples, [name], 0.85), []
        for each in (samples, spoilt):
            held = [samples.shot == other for other in names if other != name]
            found = [_error(each.select(~mask), samples.select(mask)) for mask in held]
            errors.append(np.average(found, weights=[np.count_nonzero(mask) for mask in held]))
        yield Row(f"S40, power 0.85 of {name}: error ratio", float(errors[1] / errors[0]), 1.1)


def false_tones() -> Rows:
    """Shots of fixed cameras: how many are accused of the made-up cameras, the D40's pairs, the charts, the S40."""
    made = [_departing(photographed_camera(unseen_camera(seed), known=True, seed=seed)) for seed in range(24)]
    yield Row("24 made-up cameras: shots accused", float(sum(map(len, made))), 0)
    pairs = read_published_pairs()
    yield Row("D40: shots accused", float(len(_departing(samples_of("D40", pairs.balanced, pairs.encoded)))), 0)
    charts = read_samples(CHARTS)
    accused = [len(_departing(charts.select(charts.camera == camera))) for camera in np.unique(charts.camera)]
    yield Row("10 chart cameras: shots accused", float(sum(accused)), 0)


def parts(folder: Path | None, keep: Path) -> dict[str, Callable[[], Rows]]:
    """What is measured, by name."""
    made: dict[str, Callable[[], Rows]] = {
        "simulated_falloff": simulated_falloff,
        "false_falloffs": false_falloffs,
        "simulated_gains": simulated_gains,
        "simulated_tone": simulated_tone,
        "false_tones": false_tones,
        "demo_picture": lambda: pictures_of_today.demo_picture(keep),
        "refinished_pairs": lambda: pictures_of_today.refinished_pairs(keep),
    }
    if folder is None:
        return made
    return {"s40_falloff": lambda: s40_falloff(folder), "s40_tone": lambda: s40_tone(folder), **made}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the parts whose names hold a word")
    parser.add_argument("--data", type=Path, default=os.environ.get("LUTFORGE_TEST_DATA"))
    parser.add_argument("--keep", type=Path, default=Path(tempfile.gettempdir()) / "lutforge-today", metavar="FOLDER")
    arguments = parser.parse_args()
    print(f"{'':64s}{'value':>9s}{'target':>9s}{'before':>9s}")
    for name, measure in parts(Path(arguments.data) if arguments.data else None, arguments.keep).items():
        if arguments.only and not any(word in name for word in arguments.only):
            continue
        for row in measure():
            before = f"{BEFORE[row.name]:9.4f}" if row.name in BEFORE else f"{'–':>9s}"
            missed = "  MISSED" if row.value > row.target else ""
            print(f"{row.name:64s}{row.value:9.4f}{row.target:9.4f}{before}{missed}", flush=True)


if __name__ == "__main__":
    main()
