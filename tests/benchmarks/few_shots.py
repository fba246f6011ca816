"""How seldom a calibration from one to four shots is worse than the best plain method, on shots that it has not seen.

    python -m tests.benchmarks.few_shots [draws [nodes per axis [number of the first draw]]]

A draw takes one to four shots of the Canon S40, of one style of the demo's simulated camera, or of one light of a chart
camera, fits the profile and the baselines to them, and predicts the other shots. Printed per camera, and of all: the
share of draws in which the profile's mean error is at most 1.02 times that of the baseline which predicts best; the
median and the largest ratio; then the draws that are worse.
"""

import sys
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import lutforge as lf
from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.preparation import prepare
from lutforge.calibration.style import style_data
from lutforge.evaluation.methods import fit_baselines, fits_of_profile
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.photograph import demo_shots
from tests.benchmarks.common import heading, row
from tests.cases.real_data import CHARTS, S40

AT_MOST = 1.02
Ratios = dict[str, float]
"""By direction, the profile's error over that of the best baseline."""


def shot_sets() -> dict[str, list[SampleSet]]:
    """By kind of camera, sets of shots that one draw takes its shots from: of one style, light and camera each."""
    with TemporaryDirectory() as folder:
        demo = lf.sample(demo_shots(Path(folder)).calibration)
    charts = read_samples(CHARTS)
    lights = np.array([name.split("-")[0] for name in charts.shot.tolist()])
    return {
        "S40": [read_samples(S40)],
        "demo": [demo.select(demo.style == style) for style in np.unique(demo.style)],
        "charts": [
            charts.select((charts.camera == camera) & (lights == light))
            for camera in np.unique(charts.camera)
            for light in np.unique(lights)
        ],
    }


def draws(count: int, size: int, first: int) -> Iterator[tuple[str, str, Ratios]]:
    """Kind of camera, what was drawn, and its ratios; the kinds take turns."""
    sets = shot_sets()
    for number in range(first, first + count):
        rng = np.random.default_rng(number)
        kind = list(sets)[number % len(sets)]
        samples = sets[kind][rng.integers(len(sets[kind]))]
        names = np.unique(samples.shot)
        shots = sorted(rng.choice(names, min(int(rng.integers(1, 5)), len(names) - 1), replace=False).tolist())
        yield kind, f"{samples.camera[0]}: {', '.join(shots)}", ratios(samples, shots, size)


def ratios(samples: SampleSet, shots: list[str], size: int) -> Ratios:
    """Calibrate from some of the shots, and compare what is predicted of the others."""
    few = np.isin(samples.shot, shots)
    prepared = (prepare(samples.select(rows), CalibrationOptions()) for rows in (few, ~few))
    train, others = (next(iter(style_data(one.samples, one.multipliers)[0].values())) for one in prepared)
    (style,) = lf.calibrate(samples.select(few), CalibrationOptions(size=size)).styles.values()
    (profile,) = fits_of_profile(style, None).values()
    baselines, raw, jpeg = fit_baselines(train).values(), others.balanced, others.encoded

    def error(colours: Array, truth: Array) -> float:
        return float(np.linalg.norm(colours - truth, axis=1).mean())

    rendered = [error(np.clip(fit.render(raw), 0.0, 1.0), jpeg) for fit in (profile, *baselines)]
    linear = [error(fit.linearize(jpeg), raw) for fit in (profile, *baselines)]
    return {"render": rendered[0] / min(rendered[1:]), "linearize": linear[0] / min(linear[1:])}


def main() -> None:
    """Print the shares."""
    count, size, first = [*map(int, sys.argv[1:]), *(200, CalibrationOptions().size, 0)[len(sys.argv) - 1 :]]
    drawn = list(draws(count, size, first))
    kinds = np.array([kind for kind, _, _ in drawn])
    for direction in ("render", "linearize"):
        values = np.array([ratio[direction] for _, _, ratio in drawn])
        heading(direction, "draws", "within", "median", "largest")
        for kind, rows in {**{str(kind): kinds == kind for kind in np.unique(kinds)}, "all": kinds != ""}.items():
            within = f"{np.mean(values[rows] <= AT_MOST):.1%}"
            row(kind, str(rows.sum()), within, np.median(values[rows]), values[rows].max(), places=3)
        for (_, what, _), value in zip(drawn, values, strict=True):
            if value > AT_MOST:
                print(f"    {value:.3f}  {what}")


if __name__ == "__main__":
    main()
