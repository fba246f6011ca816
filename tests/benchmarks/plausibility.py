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
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.physical.white_balance import complete_multipliers
from lutforge.calibration.plausibility.check import implausible
from lutforge.calibration.plausibility.colour_chain import curve_terms
from lutforge.calibration.plausibility.whole_set import Colours, fitted_chain
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.colour.spectra import WAVELENGTHS, chart_reflectances
from lutforge.colour.srgb import srgb_decode
from lutforge.model.diagnosis import Diagnosis
from lutforge.samples.sample_set import SampleSet, concatenate
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import (
    SimulatedCamera,
    SimulatedStyle,
    SimulatedWhiteBalance,
    _fit_matrix,
    nikon_d5100,
    sigma_sd_merrill,
)
from tests.benchmarks.unseen_cameras import UnseenCamera, _gamut_map, _light, _response
from tests.calibration.samples_simulated import chart_140, photograph_patches, surfaces
from tests.real_data import CHARTS, S40, read_published_pairs

Case = Callable[[SampleSet, np.random.Generator], SampleSet]


def d40(seed: int) -> SampleSet:
    """The published pairs, dealt to ten shots."""
    pairs, rng = read_published_pairs(), np.random.default_rng(seed)
    count = len(pairs.balanced)
    setting, shot = np.arange(count) % len(pairs.multipliers), rng.integers(0, 10, count)
    wb = np.array(list(pairs.multipliers.values()))[setting]
    name, style, times = np.full(count, "Nikon D40"), np.full(count, "standard"), np.full(count, 0.01)
    shots, patches = np.char.add("S", shot.astype(str)), np.arange(count).astype(str)
    names = np.array(list(pairs.multipliers))[setting]
    samples = SampleSet(name, style, names, shots, patches, times, pairs.balanced / wb, pairs.encoded, wb, name)
    return samples.select(np.argsort(shot, kind="stable"))


def s40(seed: int) -> SampleSet:
    """Five photographs, without a tenth of their samples."""
    samples = read_samples(S40)
    return samples.select(np.random.default_rng(seed).random(len(samples)) > 0.1)


def simulated(camera: SimulatedCamera, seed: int, style: str = "standard", shots: int = 10) -> SampleSet:
    """Shots of surfaces of their own, under lights and at exposures drawn at random."""
    rng, parts = np.random.default_rng(seed), []
    balances = list(camera.white_balances)
    for shot in range(shots):
        light, stop = balances[rng.integers(len(balances))], (-4.0, -3.0, -2.0, -1.0, 0.0, 0.5)[rng.integers(6)]
        taken = photograph_patches(
            camera, surfaces(80, 100 * seed + shot), styles=(style,), balances=(light,), stops=(stop,),
            seed=1000 * seed + shot,
        )  # fmt: skip
        parts.append(replace(taken, shot=np.char.add(f"{style}{shot} ", taken.shot)))
    return concatenate(parts)


SETS: dict[str, Callable[[int], SampleSet]] = {
    "D5100": lambda seed: simulated(nikon_d5100(), seed),
    "SD Merrill": lambda seed: simulated(sigma_sd_merrill(), seed),
    "D40": d40,
    "S40": s40,
}


def _srgb(change: Callable[[Array], Array]) -> Case:
    return lambda samples, rng: replace(samples, srgb=np.clip(change(samples.srgb), 0.0, 1.0))


def _raw(change: Callable[[Array, Array], Array]) -> Case:
    return lambda samples, rng: replace(samples, raw=np.clip(change(samples.raw, samples.wb), -0.05, 1.0))


def brightened(samples: SampleSet, factor: Array) -> Array:
    """JPEG values (n, 3) developed brighter by factors (n,): by the simulated camera, else by the curve they tell."""
    for camera in (nikon_d5100(), sigma_sd_merrill()):
        if camera.name == samples.camera[0]:
            return camera.render(samples.raw * samples.wb * factor[:, None], "standard", np.ones(3))
    colours = Colours(samples.raw, samples.srgb, samples.wb, samples.white_balance, known=True)
    chain = fitted_chain(colours)
    linear = np.maximum(curve_terms(samples.srgb) @ chain.curve, 0.0)
    top = float((curve_terms(np.ones(1)) @ chain.curve)[0])
    return chain.encoded(np.minimum(linear * factor[:, None], top))


def _each_brightened(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    names, index = np.unique(samples.shot, return_inverse=True)
    return replace(samples, srgb=brightened(samples, 2.0 ** rng.uniform(-0.3, 0.3, len(names))[index]))


def _livelier(encoded: Array) -> Array:
    """Another style: more saturation and contrast."""
    grey = (encoded @ [0.25, 0.5, 0.25])[:, None]
    lively = np.clip(grey + 1.25 * (encoded - grey), 0.0, 1.0)
    return np.asarray(lively + 0.12 * lively * (1 - lively) * (2 * lively - 1))


def _other_style(share: float) -> Case:
    def change(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
        names = rng.permutation(np.unique(samples.shot))
        rows = np.isin(samples.shot, names[: max(1, round(share * len(names)))])
        return replace(samples, srgb=np.where(rows[:, None], _livelier(samples.srgb), samples.srgb))

    return change


def _other_sensor(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    """Four shots of another sensor, or on real cameras of this one with a matrix before it."""
    names = rng.permutation(np.unique(samples.shot))
    rows = np.isin(samples.shot, names[: max(1, round(0.3 * len(names)))])
    mixing = np.array([[0.82, 0.18, 0.0], [0.06, 0.88, 0.06], [0.0, 0.18, 0.82]])
    raw, wb = samples.raw.copy(), samples.wb.copy()
    raw[rows] = samples.raw[rows] @ mixing.T
    neutral = (1.0 / samples.wb[rows]) @ mixing.T
    wb[rows] = neutral[:, 1:2] / neutral
    return replace(samples, raw=raw, wb=wb)


def _exchanged(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    """The multipliers of the warmest and the coolest setting exchanged."""
    wb, names = samples.wb.copy(), np.unique(samples.white_balance)
    warmth = [np.median(wb[samples.white_balance == name, 0]) for name in names]
    first, last = (samples.white_balance == names[place] for place in (np.argmin(warmth), np.argmax(warmth)))
    wb[first], wb[last] = np.median(samples.wb[last], axis=0), np.median(samples.wb[first], axis=0)
    return replace(samples, wb=wb)


def _renamed(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    """Tungsten and daylight with each other's names."""
    other = {"tungsten": "daylight", "daylight": "tungsten"}
    return replace(samples, white_balance=np.array([other.get(str(name), str(name)) for name in samples.white_balance]))


def _slipped(samples: SampleSet, rng: np.random.Generator) -> SampleSet:
    srgb, rows = samples.srgb.copy(), np.flatnonzero(samples.shot == rng.choice(np.unique(samples.shot)))
    srgb[rows] = np.roll(srgb[rows], int(rng.integers(1, 4)), axis=0)
    return replace(samples, srgb=srgb)


BLACK = 600.0 / 15520.0
CASES: dict[str, tuple[str, Case]] = {
    "red and blue of the JPEG swapped": ("blue of the JPEG", _srgb(lambda srgb: srgb[:, ::-1])),
    "JPEG values linear": ("linear", _srgb(srgb_decode)),
    "JPEG developed +1 EV": (
        "developed", lambda samples, rng: replace(samples, srgb=brightened(samples, np.full(len(samples), 2.0)))
    ),
    "RAW scaled by 1/4": ("white level", _raw(lambda raw, wb: raw / 4)),
    "green counted twice": ("counted twice", _raw(lambda raw, wb: raw * [1, 2, 1])),
    "codes lifted by 8": ("lifted", _srgb(lambda srgb: srgb + 8 / 255)),
    "one in ten shots of another style": ("picture style", _other_style(0.1)),
    "half of the shots of another style": ("picture style", _other_style(0.5)),
    "a third of the shots of another sensor": ("another sensor", _other_sensor),
    "multipliers of two white balances exchanged": ("exchanged", _exchanged),
    "names of two white balances exchanged": ("other's name", _renamed),
    "Adobe RGB without a label": (
        "Adobe RGB",
        _srgb(lambda srgb: np.clip(srgb_decode(srgb) @ matrix_between("srgb", "adobe-rgb").T, 0, 1) ** (256 / 563)),
    ),
    "sepia": ("toned", _srgb(lambda srgb: (srgb @ [0.3, 0.59, 0.11])[:, None] * [1.07, 0.95, 0.75])),
    "rows shifted within a shot": ("rows", _slipped),
    "RAW white-balanced already": ("already", _raw(lambda raw, wb: raw * wb)),
    "black level left in": ("left in", _raw(lambda raw, wb: raw * (1 - BLACK) + BLACK)),
    "black level taken twice": ("more than the black", _raw(lambda raw, wb: (raw - BLACK) / (1 - BLACK))),
    "black level 700 for 600": ("more than the black", _raw(lambda raw, wb: raw - 100.0 / 14920.0)),
    "each JPEG brightened by up to 0.3 EV": ("brightened", _each_brightened),
    "white balance shifted in the camera": (
        "shifted in", lambda samples, rng: replace(samples, wb=samples.wb * [1.1, 1.0, 0.92])
    ),
}  # fmt: skip
"""What is done to good samples, and words of the cause that is to be named."""


def diagnosed(samples: SampleSet) -> tuple[Diagnosis, ...]:
    """What is told of samples."""
    return implausible(samples, complete_multipliers(samples)[0])


def applies(case: str, name: str) -> bool:
    """The S40's shots have an automatic white balance, so none to exchange."""
    return name != "S40" or "white balances" not in case


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


def camera_of(name: str, sensitivity: Array, seed: int) -> SampleSet:
    """Shots of a camera with measured sensitivities and a rendering drawn at random."""
    rng = np.random.default_rng([seed, 77])
    sensitivity = sensitivity / sensitivity.max(axis=0) * (rng.uniform(0.5, 1), 1.0, rng.uniform(0.5, 1))
    matrix = _fit_matrix(sensitivity)
    kelvin: dict[str, float | str] = {
        "tungsten": "A",
        "fluorescent": "FL2",
        "daylight": 5200.0,
        "cloudy": 6000.0,
        "shade": 7500.0,
    }
    chosen = rng.permutation(list(kelvin))[: rng.integers(1, 6)].tolist()
    lights = {setting: _light(kelvin[setting]) for setting in chosen}
    balances = {}
    for setting, spectrum in lights.items():
        r, g, b = spectrum @ sensitivity
        balances[setting] = SimulatedWhiteBalance((g / r, 1.0, g / b), 5000.0)
    style = SimulatedStyle("standard", _gamut_map(rng, matrix), _response(rng))  # type: ignore[arg-type]  # any h and f
    camera = UnseenCamera(
        "LutForge", name, sensitivity, matrix, balances, {"standard": style}, full_well=rng.uniform(15e3, 60e3),
        lights=lights,
    )  # fmt: skip
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
            yield from ((f"{name} {turn}", camera_of(name, sensitivity, 1000 * turn + seed)) for turn in (1, 2))


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
            cells.append(f"{np.mean([any(words in each.cause for each in told) for told in found]):.0%}")
        print(f"{case:46s}" + "".join(f"{cell:>12s}" for cell in cells), flush=True)
    accused, count, seconds = [], 0, 0.0
    for name, samples in good_sets(draws):
        began = time.perf_counter()
        told = diagnosed(samples)
        count, seconds = count + 1, seconds + time.perf_counter() - began
        accused += [f"{name}: {told[0].cause}"] if told else []
    print(f"good sets accused: {len(accused)} of {count}, {seconds / count:.2f} s a set")
    print("\n".join(accused))


if __name__ == "__main__":
    main()
