"""How surely samples that no camera makes are told by their cause, and how seldom good ones are accused.

    python -m tests.benchmarks.plausibility [draws]

Prints, per case and set, the share of draws in which the cause was named; then the good sets that were accused: the
simulated cameras, a Nikon D40, a Canon S40, ten chart cameras, and cameras with the sensitivities of 80 measured
sensors and tone curves, gamut maps, lights and charts drawn at random. A draw of the D40 deals its samples to ten
shots, one of the S40 leaves a tenth of its samples out, one of a simulated camera makes ten new shots.
LUTFORGE_TEST_DATA names the folder of measured sensitivities; without it these cameras are left out.
"""

import json
import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.colour.spectra import WAVELENGTHS, chart_reflectances
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from tests.cases.cameras import camera_of, random_gamut_map, random_response
from tests.cases.real_data import CHARTS
from tests.cases.samples import chart_140, photograph_patches, surfaces
from tests.cases.spoilt_samples import CASES, SETS, applies, diagnosed


def sensors(folder: Path) -> Iterator[tuple[str, Array]]:
    """Measured sensitivities (L, 3) over `spectra.WAVELENGTHS`: rawtoaces-data, and Jiang et al. 2013."""
    for path in sorted((folder / "rawtoaces-data" / "camera").glob("*.json")):
        data = json.loads(path.read_text(encoding="utf-8"))["spectral_data"]["data"]["main"]
        values = np.array(list(data.values()))
        yield path.stem.removesuffix("_380_780_5"), _resampled(np.array([float(key) for key in data]), values)
    lines = (folder / "jiang2013_28_cameras.txt").read_text(encoding="utf-8").splitlines()
    for place, line in enumerate(lines):
        if "\t" in line and "\t" not in lines[place - 1]:
            rows = [[float(cell) for cell in text.split()] for text in lines[place : place + 3]]
            yield lines[place - 1].strip(), _resampled(np.arange(400.0, 721.0, 10.0), np.array(rows).T)


def _resampled(wavelengths: Array, values: Array) -> Array:
    return np.column_stack([np.interp(WAVELENGTHS, wavelengths, column, left=0, right=0) for column in values.T])


def photographed(name: str, sensitivity: Array, seed: int) -> SampleSet:
    """Shots of a camera with measured sensitivities and a rendering drawn at random."""
    rng = np.random.default_rng([seed, 77])
    sensitivity = sensitivity / sensitivity.max(axis=0) * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))
    lights = {"tungsten": "A", "fluorescent": "FL2", "daylight": "5200K", "cloudy": "6000K", "shade": "7500K"}
    chosen = rng.permutation(list(lights))[: rng.integers(1, 6)].tolist()
    gamut_map, response = random_gamut_map(rng, sensitivity), random_response(rng)
    settings = {setting: lights[setting] for setting in chosen}
    camera = camera_of(name, sensitivity, settings, gamut_map, response, full_well=rng.uniform(15e3, 60e3))
    chart = (chart_reflectances(), chart_140(seed), surfaces(200, seed))[rng.integers(3)]
    stops = tuple(np.sort(rng.uniform(-5, 1, rng.integers(3, 7))).tolist())
    return photograph_patches(camera, chart, balances=chosen, stops=stops, seed=seed)


def good_sets(draws: int) -> Iterator[tuple[str, SampleSet]]:
    """Sets of samples with nothing wrong."""
    for name, make in SETS.items():
        yield from ((f"{name} {seed}", make(seed)) for seed in range(draws))
    charts = read_samples(CHARTS)
    for camera in np.unique(charts.camera):
        for light in ("light1", "light2"):
            yield f"{camera} {light}", charts.select((charts.camera == camera) & np.char.startswith(charts.shot, light))
    folder = Path(os.environ.get("LUTFORGE_TEST_DATA", "")) / "spectra"
    if folder.is_dir():
        for seed, (name, sensitivity) in enumerate(sensors(folder)):
            yield from ((f"{name} {turn}", photographed(name, sensitivity, 1000 * turn + seed)) for turn in (1, 2))


def main() -> None:
    """Print both tables."""
    draws = int(sys.argv[1]) if len(sys.argv) > 1 else 10
    print(f"{'':46s}" + "".join(f"{name:>12s}" for name in SETS))
    drawn = {name: [make(seed) for seed in range(draws)] for name, make in SETS.items()}
    for case, (words, spoil) in CASES.items():
        cells = []
        for name, sets in drawn.items():
            if not applies(case, name):
                cells.append("–")
                continue
            rng = np.random.default_rng(1)
            found = [diagnosed(spoil(samples, rng)) for samples in sets]
            cells.append(f"{np.mean([any(words in each for each in told) for told in found]):.0%}")
        print(f"{case:46s}" + "".join(f"{cell:>12s}" for cell in cells), flush=True)
    accused, count, seconds = [], 0, 0.0
    for name, samples in good_sets(draws):
        began = time.perf_counter()
        told = diagnosed(samples)
        count, seconds = count + 1, seconds + time.perf_counter() - began
        accused += [f"{name}: {told[0]}"] if told else []
    print(f"good sets accused: {len(accused)} of {count}, {seconds / count:.2f} s a set")
    print("\n".join(accused))


if __name__ == "__main__":
    main()
