"""What cameras of today do beyond a fixed rendering: how well it is found, and what it costs on unseen shots.

    python -m tests.benchmarks.cameras_of_today [--only WORD …] [--json FILE] [--compare FILE] [--keep FOLDER]

Prints figures with the most that each may be. Errors are mean norms of the RGB difference of rendered colours, 1 = full
scale, of shots that the calibration had not seen, divided by the same without falloff, gain or tone. LUTFORGE_TEST_DATA
has the shots of the Canon S40; rows that need them are left out without. Lattices have 17 nodes per axis.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.calibration.departures import departing_shots
from lutforge.calibration.falloff import at_the_centre, fit_falloffs
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.style import unclipped
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from tests.benchmarks import common
from tests.benchmarks.common import Array, Figure, Figures, Parts, left_out
from tests.cases.cameras import photographed as photographed_camera
from tests.cases.cameras import unseen_camera
from tests.cases.real_data import CHARTS
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
from tests.cases.spoilt_samples import d40

OPTIONS = CalibrationOptions(size=17)


def unseen_error(samples: SampleSet, *, unseen: SampleSet | None = None) -> float:
    """The mean error on shots that are not calibrated from: the unseen ones, else each shot of the samples in turn."""
    pairs = [(rest, own) for _, rest, own in left_out(samples)] if unseen is None else [(samples, unseen)]
    errors = [_error(*pair) for pair in pairs]
    return float(np.average(errors, weights=[len(own) for _, own in pairs]))


def _error(seen: SampleSet, unseen: SampleSet) -> float:
    rows = lf.evaluate(lf.calibrate(seen, OPTIONS), unseen).rows
    return next(
        row.figures.mean for row in rows if (row.direction, row.shot, row.method) == ("render", "all", "lattice")
    )


def found_stops(profile: lf.CameraProfile, samples: SampleSet) -> Array:
    """What the profile takes the falloff at the places of samples for, (n,); nothing where it has none."""
    return np.asarray(np.log2(at_the_centre(samples, profile.falloffs).raw[:, 1] / samples.raw[:, 1]))


def s40_falloff(samples: SampleSet) -> Figures:
    """Corrected falloffs of the S40: RAW darkened, or JPEGs brightened through the camera's own rendering."""
    profile = lf.calibrate(samples, OPTIONS)
    clean = unseen_error(samples)
    yield Figure("S40 as it is: falloffs found", float(len(profile.falloffs)), 0)
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
            yield Figure(f"{what}, {way}: falloff off by at most, EV", float(np.abs(found - stops).max()), 0.05)
            yield Figure(f"{what}, {way}: error ratio", unseen_error(spoilt) / clean, 1.15)
    stops = np.where(lens == "one", lost_stops(samples, 1.2), lost_stops(samples, 0.5))
    two = with_dark_corners(replace(samples, lens=lens), stops)
    found = found_stops(lf.calibrate(two, OPTIONS), two)
    yield Figure("S40, two lenses, 1.2 and 0.5 EV: off by at most, EV", float(np.abs(found - stops).max()), 0.05)
    yield Figure("S40, two lenses, 1.2 and 0.5 EV: error ratio", unseen_error(two) / clean, 1.15)


def photographed(patches: Array, seed: int, name: str) -> SampleSet:
    """Surfaces by the simulated camera, at places drawn over the picture."""
    samples = photograph_patches(nikon_d5100(), patches, stops=(-3, -2, -1, 0), seed=seed)
    return spread_over_picture(replace(samples, shot=np.char.add(samples.shot, f" {name}")), seed)


def simulated_falloff() -> Figures:
    """Corrected falloffs of the simulated camera, of two shapes."""
    seen, unseen = photographed(chart_140(), 1, "seen"), photographed(surfaces(200, 99), 2, "unseen")
    clean = unseen_error(seen, unseen=unseen)
    yield Figure("simulated, none: falloffs found", float(len(lf.calibrate(seen, OPTIONS).falloffs)), 0)
    for ev, power in ((0.5, 1.0), (1.0, 1.0), (2.0, 1.0), (1.0, 2.0)):
        spoilt = [with_dark_corners(each, lost_stops(each, ev, power=power)) for each in (seen, unseen)]
        what = f"simulated, {ev:g} EV, r^{2 * power:g}"
        found = found_stops(lf.calibrate(spoilt[0], OPTIONS), spoilt[0])
        yield Figure(
            f"{what}: falloff off by at most, EV", float(np.abs(found - lost_stops(seen, ev, power=power)).max()), 0.05
        )
        yield Figure(f"{what}: error ratio", unseen_error(spoilt[0], unseen=spoilt[1]) / clean, 1.3)


def false_falloffs() -> Figures:
    """Draws of a few shots without falloff: how often one is reported."""
    reported = []
    for seed in range(60):
        rng = np.random.default_rng([seed, 11])
        balances = tuple(rng.permutation(("tungsten", "daylight", "cloudy", "shade"))[: rng.integers(1, 4)])
        patches = surfaces(int(rng.integers(24, 120)), seed)
        samples = photograph_patches(nikon_d5100(), patches, balances=balances, stops=(-2, -1, 0), seed=seed)
        samples = spread_over_picture(samples, seed)
        if rng.integers(2):  # the same surfaces at the same places in all shots
            samples = replace(samples, position=samples.position[samples.patch.astype(int)])
        reported.append(bool(fit_falloffs(samples, samples.wb, unclipped(samples, samples.wb))))
    yield Figure("simulated, 60 draws without falloff: share with one", float(np.mean(reported)), 0.01)


def simulated_gains() -> Figures:
    """Five settings, each of which the camera brings up by a gain of its own before it renders it."""
    gains = dict(zip(BALANCES, (0.9, 0.95, 1.0, 1.05, 1.1), strict=True))
    seen, unseen = photographed(chart_140(), 1, "seen"), photographed(surfaces(200, 99), 2, "unseen")
    clean = unseen_error(seen, unseen=unseen)
    seen, unseen = (
        replace(each, raw=each.raw / np.array([gains[str(name)] for name in each.white_balance])[:, None])
        for each in (seen, unseen)
    )
    balances = lf.calibrate(seen, OPTIONS).white_balances
    off = max(abs(balances[name].gain / gain - 1.0) for name, gain in gains.items())
    yield Figure("simulated, gains 0.9 to 1.1: gain off by at most", off, 0.003)
    yield Figure("simulated, gains 0.9 to 1.1: error ratio", unseen_error(seen, unseen=unseen) / clean, 1.05)


def simulated_tone() -> Figures:
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
        yield Figure(f"simulated, {what}: error ratio", unseen_error(samples, unseen=unseen) / clean, 1.1)


def _departing(samples: SampleSet) -> set[str]:
    multipliers = complete_multipliers(samples)[0]
    return {each.shot for each in departing_shots(samples, multipliers, unclipped(samples, multipliers))}


def _tone_rows(what: str, samples: SampleSet, shots: list[str]) -> Figures:
    found = _departing(samples)
    yield Figure(f"{what}: not found", float(len(set(shots) - found)), 0)
    yield Figure(f"{what}: others accused", float(len(found - set(shots))), 0)


def s40_tone(samples: SampleSet) -> Figures:
    """A power of 0.85 of the codes of each of the S40's shots in turn; errors are of the four others."""
    names = [str(name) for name in np.unique(samples.shot)]
    for name in names:
        yield from _tone_rows(f"S40, power 0.85 of {name}", with_gamma(samples, [name], 0.85), [name])
    for name in names[:2]:
        spoilt, errors = with_gamma(samples, [name], 0.85), []
        others = [own for shot, _, own in left_out(samples) if shot != name]
        for each in (samples, spoilt):
            predicted = [_error(each.select(each.shot != own.shot[0]), own) for own in others]
            errors.append(np.average(predicted, weights=[len(own) for own in others]))
        yield Figure(f"S40, power 0.85 of {name}: error ratio", float(errors[1] / errors[0]), 1.1)


def false_tones() -> Figures:
    """Shots of fixed cameras: how many are accused of the made-up cameras, the D40's pairs, the charts, the S40."""
    made = [_departing(photographed_camera(unseen_camera(seed), known=True, seed=seed)) for seed in range(24)]
    yield Figure("24 made-up cameras: shots accused", float(sum(map(len, made))), 0)
    yield Figure("D40: shots accused", float(len(_departing(d40(0)))), 0)
    charts = read_samples(CHARTS)
    accused = [len(_departing(charts.select(charts.camera == camera))) for camera in np.unique(charts.camera)]
    yield Figure("10 chart cameras: shots accused", float(sum(accused)), 0)


def parts(keep: Path) -> Parts:
    """What is measured, by name."""
    data, real = common.real_data(), {}
    if data is not None:
        samples = common.s40(data, keep)
        real = {"s40_falloff": partial(s40_falloff, samples), "s40_tone": partial(s40_tone, samples)}
    made = (simulated_falloff, false_falloffs, simulated_gains, simulated_tone, false_tones)
    simulated: dict[str, Callable[[], Figures]] = {part.__name__: part for part in made}
    return real | simulated


if __name__ == "__main__":
    sys.exit(common.measured(parts, common.parser(__doc__).parse_args()))
