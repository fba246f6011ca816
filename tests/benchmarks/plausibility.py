"""How surely samples that no camera makes are told by their cause, and how seldom good ones are accused.

    python -m tests.benchmarks.plausibility [draws]

Prints, per case and set, the share of draws in which the cause was named; then the good sets that were accused: the
simulated cameras, a Nikon D40, a Canon S40, ten chart cameras, and cameras with the sensitivities of 80 measured
sensors and tone curves, gamut maps, lights and charts drawn at random. A draw of the D40 deals its samples to ten
shots, one of the S40 leaves a tenth of its samples out, one of a simulated camera makes ten new shots.
LUTFORGE_TEST_DATA names the folder of measured sensitivities; without it these cameras are left out.
"""

import sys
import time
from collections.abc import Iterator

import numpy as np

from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from tests.benchmarks.common import heading, real_data, row
from tests.cases.cameras import photographed_at_random
from tests.cases.real_data import CHARTS, sensors
from tests.cases.spoilt_samples import CASES, SETS, applies, diagnosed


def good_sets(draws: int) -> Iterator[tuple[str, SampleSet]]:
    """Sets of samples with nothing wrong."""
    for name, make in SETS.items():
        yield from ((f"{name} {seed}", make(seed)) for seed in range(draws))
    charts = read_samples(CHARTS)
    for camera in np.unique(charts.camera):
        for light in ("light1", "light2"):
            yield f"{camera} {light}", charts.select((charts.camera == camera) & np.char.startswith(charts.shot, light))
    data = real_data()
    if data is not None:
        for seed, (name, sensitivity) in enumerate(sensors(data).items()):
            yield from (
                (f"{name} {turn}", photographed_at_random(name, sensitivity, 1000 * turn + seed)) for turn in (1, 2)
            )


def main() -> None:
    """Print both tables."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    drawn = {name: [make(seed) for seed in range(draws)] for name, make in SETS.items()}
    heading("named", *drawn)
    for case, (words, spoil) in CASES.items():
        cells = []
        for name, sets in drawn.items():
            rng = np.random.default_rng(1)
            named = [any(words in cause for cause in diagnosed(spoil(one, rng))) for one in sets if applies(case, name)]
            cells.append(f"{np.mean(named):.0%}" if named else "–")
        row(case, *cells)
    accused, count, seconds = [], 0, 0.0
    for name, samples in good_sets(draws):
        began = time.perf_counter()
        causes = diagnosed(samples)
        count, seconds = count + 1, seconds + time.perf_counter() - began
        accused += [f"{name}: {causes[0]}"] if causes else []
    print(f"\ngood sets accused: {len(accused)} of {count}, {seconds / count:.2f} s a set")
    print("\n".join(accused))


if __name__ == "__main__":
    main()
