"""How seldom a calibration from one to four shots is worse than the best plain method, on shots that it has not seen.

    python -m tests.benchmarks.few_shots [draws [nodes per axis [number of the first draw]]]

A draw takes one to four shots of the Canon S40, of one style of the demo's simulated camera, or of one light of a chart
camera, fits the profile and the baselines to them, and predicts the other shots. Printed per camera, and of all: the
share of draws in which the profile's mean error is at most 1.02 times that of the baseline which predicts best; the
median and the largest ratio; then the draws that are worse.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

import lutforge as lf
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.preparation import data_by_style
from lutforge.evaluation.methods import Fit, fit_baselines, fits_of_profile
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.demo import demo_shots
from tests.cases.real_data import CHARTS, S40

Array = NDArray[np.float64]

DRAWS = 200
AT_MOST = 1.02


@dataclass(frozen=True)
class Draw:
    """camera: its kind; shots: that were calibrated from; render, linearize: error beside the best baseline's."""

    camera: str
    shots: tuple[str, ...]
    render: float
    linearize: float


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


def draws(count: int, size: int, first: int) -> Iterator[Draw]:
    """Make draws, of the kinds of cameras in turn."""
    sets = shot_sets()
    for number in range(first, first + count):
        rng = np.random.default_rng(number)
        kind = list(sets)[number % len(sets)]
        samples = sets[kind][rng.integers(len(sets[kind]))]
        names = np.unique(samples.shot)
        taken = rng.choice(names, min(int(rng.integers(1, 5)), len(names) - 1), replace=False)
        yield one_draw(kind, samples, tuple(sorted(taken.tolist())), size)


def one_draw(kind: str, samples: SampleSet, shots: tuple[str, ...], size: int) -> Draw:
    """Calibrate from some of the shots, and compare what is predicted of the others."""
    few = np.isin(samples.shot, shots)
    (train,) = data_by_style(samples.select(few)).values()
    (others,) = data_by_style(samples.select(~few)).values()
    (style,) = lf.calibrate(samples.select(few), CalibrationOptions(size=size)).styles.values()
    (profile,) = fits_of_profile(style, None).values()
    baselines = fit_baselines(train).values()
    raw, jpeg = others.balanced, others.encoded
    return Draw(
        f"{kind} {samples.camera[0]}",
        shots,
        _clipped_error(profile, raw, jpeg) / min(_clipped_error(fit, raw, jpeg) for fit in baselines),
        _error(profile.linearize(jpeg), raw) / min(_error(fit.linearize(jpeg), raw) for fit in baselines),
    )


def _clipped_error(fit: Fit, raw: Array, jpeg: Array) -> float:
    return _error(np.clip(fit.render(raw), 0.0, 1.0), jpeg)


def _error(found: Array, wanted: Array) -> float:
    return float(np.linalg.norm(found - wanted, axis=1).mean())


def _row(name: str, ratios: Array) -> str:
    within = 100 * np.mean(ratios <= AT_MOST)
    return (
        f"{name:<24} {len(ratios):4} draws {within:5.1f} %  median {np.median(ratios):.3f}  largest {ratios.max():.3f}"
    )


def main() -> None:
    """Print the shares."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else DRAWS
    size = int(sys.argv[2]) if len(sys.argv) > 2 else CalibrationOptions().size
    first = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    found = list(draws(count, size, first))
    for direction in ("render", "linearize"):
        ratios = np.array([draw.render if direction == "render" else draw.linearize for draw in found])
        kinds = np.array([draw.camera.split()[0] for draw in found])
        for kind in np.unique(kinds):
            print(_row(f"{direction}, {kind}", ratios[kinds == kind]))
        print(_row(f"{direction}, all", ratios))
        for draw, ratio in zip(found, ratios, strict=True):
            if ratio > AT_MOST:
                print(f"    {ratio:.3f}  {draw.camera}: {', '.join(draw.shots)}")


if __name__ == "__main__":
    main()
