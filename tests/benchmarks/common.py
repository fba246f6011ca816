"""What benchmarks share: data and splits, how figures are measured, compared and kept, how tables are printed."""

import argparse
import json
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

import lutforge as lf
from lutforge.arrays import Array
from lutforge.cli.demo_shots import DemoShots, demo_shots
from lutforge.simulate.camera import SimulatedCamera

ROOT = Path(__file__).resolve().parents[2]
WORSE = 1.03
"""A figure that grew by more than this ratio is marked."""
HALF_CODE = 0.5 / 255


@dataclass(frozen=True)
class Figure:
    """A figure by a stable name. limit: what it may be at most, or at least; note: what is printed behind it.

    compared: whether it is marked where it is worse than in an earlier run, as times are not.
    """

    name: str
    value: float
    limit: float = np.inf
    unit: str = ""
    at_least: bool = False
    note: str = ""
    compared: bool = True

    @property
    def held(self) -> bool:
        return self.value >= self.limit if self.at_least else self.value <= self.limit


Figures = Iterator[Figure]
Parts = Mapping[str, Callable[[], Figures]]
"""What a benchmark measures, by name."""


def parser(doc: str | None) -> argparse.ArgumentParser:
    """What `measured` takes, with the usage of a benchmark's docstring."""
    made = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--only", nargs="+", default=[], metavar="WORD", help="the parts whose names hold a word")
    made.add_argument("--json", type=Path, help="write the figures to this file")
    made.add_argument("--compare", type=Path, help="an earlier file of figures")
    made.add_argument("--keep", type=Path, help="a folder: what is made there is used again by the next run")
    return made


def measured(parts: Callable[[Path], Parts], arguments: argparse.Namespace) -> int:
    """Print the figures of parts, which are given the folder to keep files in, as they are measured.

    Where a part fails, why is printed, and the others go on. Returns 1 where one failed or a figure is worse than that
    of an earlier run, for `sys.exit`.
    """
    before = json.loads(arguments.compare.read_text(encoding="utf-8")) if arguments.compare else {}
    values: dict[str, float] = {}
    beyond = worse = failed = 0
    with kept(arguments.keep) as keep:
        for part, measure in parts(keep).items():
            if not chosen(part, arguments.only):
                continue
            began = time.perf_counter()
            try:
                for figure in measure():
                    values[figure.name] = figure.value
                    text, grew = _line(figure, before)
                    print(text, flush=True)
                    beyond, worse = beyond + (not figure.held), worse + grew
            except Exception as error:  # whatever it is: the other parts are measured
                print(f"{part}: not measured, {type(error).__name__}: {error}", flush=True)
                failed += 1
            print(f"# {part}: {time.perf_counter() - began:.0f} s", file=sys.stderr, flush=True)
            if arguments.json:
                arguments.json.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{len(values)} figures: {beyond} beyond their limits, {worse} worse than before; {failed} parts failed")
    return int(worse > 0 or failed > 0)


def _line(figure: Figure, before: Mapping[str, float]) -> tuple[str, bool]:
    """The line of a figure, and whether it is worse than before."""
    text = f"{figure.name:<70}{figure.value:11.5g} {figure.unit:<3}"
    if np.isfinite(figure.limit):
        text += f"{'≥' if figure.at_least else '≤'} {figure.limit:<8g}{'' if figure.held else 'MISSED '}"
    worse = False
    if figure.name in before:
        earlier = before[figure.name]
        ratio = figure.value / earlier if earlier else (1.0 if figure.value == 0 else np.inf)
        worse = figure.compared and ratio > WORSE
        text += f"{earlier:11.5g}{ratio:8.3f}{'  WORSE' if worse else ''}"
    return f"{text}{figure.note}".rstrip(), worse


def chosen(name: str, words: list[str]) -> bool:
    """Whether a name holds one of the words, or none are given."""
    return not words or any(word in name for word in words)


@contextmanager
def kept(folder: Path | None) -> Iterator[Path]:
    """A folder that is kept, or a temporary one."""
    with tempfile.TemporaryDirectory() as temporary:
        keep = folder or Path(temporary)
        keep.mkdir(parents=True, exist_ok=True)
        yield keep


def heading(*cells: str) -> None:
    """Print the head of a table in Markdown."""
    print(f"\n| {' | '.join(cells)} |\n|{'---|' * len(cells)}", flush=True)


def row(name: str, *cells: str | float, places: int = 4) -> None:
    """Print a row of it."""
    texts = [cell if isinstance(cell, str) else "–" if np.isnan(cell) else f"{cell:.{places}f}" for cell in cells]
    print(f"| {' | '.join([name, *texts])} |", flush=True)


def real_data() -> Path | None:
    """The folder of real data; None where there is none, which is told."""
    folder = Path(os.environ.get("LUTFORGE_TEST_DATA", ROOT.parent / "shared" / "data"))
    if folder.is_dir():
        return folder
    print("no real data: set LUTFORGE_TEST_DATA to its folder", file=sys.stderr)
    return None


def s40(data: Path, keep: Path) -> lf.SampleSet:
    """The samples of five photographs by a Canon PowerShot S40."""
    table = keep / "s40.csv"
    if not table.exists():
        lf.sample([data / "canon_powershot_s40"]).save(table)
    return lf.read_samples(table)


def nikon_d40(data: Path) -> lf.CameraProfile:
    """The published camera model of the Nikon D40."""
    folder = data / "nus_nikon_d40"
    return lf.import_published([folder / "other_white_balances", folder / "fluorescent"], "Nikon D40")


def left_out(samples: lf.SampleSet) -> Iterator[tuple[str, lf.SampleSet, lf.SampleSet]]:
    """Each shot in turn: its name, the others' samples, and its own."""
    for name in np.unique(samples.shot):
        yield str(name), samples.select(samples.shot != name), samples.select(samples.shot == name)


@cache
def demo(keep: Path, size: int | None = None) -> tuple[DemoShots, lf.CameraProfile]:
    """The demo's shots and the profile of them; size: nodes per axis."""
    shots = demo_shots(keep / "demo")
    options = lf.CalibrationOptions() if size is None else lf.CalibrationOptions(size=size)
    return shots, lf.calibrate(lf.sample(shots.calibration), options)


def refinished_colours(shots: DemoShots) -> tuple[Array, Array, Array]:
    """RAW of the demo's held-out photograph, and what the camera makes of it before and after: none is clipped."""
    raw = lf.sample([shots.held_out.dng]).raw
    (style, balance), (target_style, target_balance) = shots.source.split("/"), shots.target.split("/")
    before = shots.camera.render(raw, style, balance)
    after = shots.camera.render(raw, target_style, target_balance, shots.ev)
    both = np.column_stack([before, after])
    inside = ((both > 0.002) & (both < 0.998)).all(axis=1)
    return raw[inside], before[inside], after[inside]


def unseen_colours(camera: SimulatedCamera, style: str, seed: int, count: int) -> tuple[Array, Array]:
    """Balanced RAW and JPEG values (count, 3) in daylight, of 8,000 drawn evenly in RAW; none clips."""
    balanced = np.random.default_rng(seed).random((8_000, 3))
    encoded = camera.render(balanced / camera.multipliers("daylight"), style, "daylight")
    inside = np.all((encoded > HALF_CODE) & (encoded < 1 - HALF_CODE), axis=1)
    return balanced[inside][:count], encoded[inside][:count]
