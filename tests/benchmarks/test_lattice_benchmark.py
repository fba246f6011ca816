"""The lattice fit beside its peers on the Nikon D40's published pairs, and its speed on up to a million samples.

    python -m pytest tests/benchmarks/test_lattice_benchmark.py --benchmark-only -s

Peers: camera-match (PyPI, the same paper; `pip install lutforge[bench]`, left out where it is missing; sparse direct
solves, each in a process of its own that is ended after LIMIT seconds: 33³ takes it half a minute, and 49³ was not done
after ten), the thesis preset, and radial basis functions. Errors are norms of the RGB difference on the 30 % held out,
those of lattices through their CLF files as OpenColorIO reads them: with the curve behind the cube, and plain. The
goals on two idle cores: 24³ from 10,000 samples ≤ 0.5 s, 33³ from a million ≤ 2 s, 65³ from a million ≤ 15 s, the
search for node levels and weights included, below 1.5 GB.
"""

import importlib.util
import multiprocessing
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.interpolate import RBFInterpolator

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.luts.processor import evaluate
from lutforge.luts.reading import file_processor
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import lattice_ops
from lutforge.model.published_model import read_published_model
from lutforge.simulate.camera import nikon_d5100
from tests.cases.samples import style_of

Array = NDArray[np.float64]
Predictor = Callable[[Array], Array]
Fit = Callable[[Array, Array], Predictor]

SIZES = (9, 13, 17, 24, 33, 49, 65)
SEEDS = (1, 2, 3, 4, 5)
LIMIT = float(os.environ.get("LUTFORGE_BENCHMARK_LIMIT", "60"))
"""Seconds that one fit of camera-match may take."""
LARGEST_MEANS = (("LutForge", 17, 0.0038),)
LARGEST_RATIO = 1.2
"""Of the maximum to that of radial basis functions."""
REPEATS, LONG = 7, 1.0
"""Of a fit that is timed, the least counts: so many, but no more once they took so many seconds."""

pytestmark = pytest.mark.skipif("--benchmark-only" not in sys.argv, reason="run with --benchmark-only")


def shot_names(count: int) -> NDArray[np.str_]:
    """Of ten shots in turn."""
    return np.array([f"shot {shot}" for shot in range(10)])[np.arange(count) % 10]


def lattice(folder: Path, options: CalibrationOptions) -> Fit:
    """LutForge's fit, matrix and response included, through a CLF file."""

    def fit(x: Array, y: Array) -> Predictor:
        fitted = fit_lattices(style_of(x, y), options).render

        def predict(points: Array) -> Array:
            Lut(lattice_ops(fitted)).write(folder / "fitted.clf")
            read = evaluate(file_processor(folder / "fitted.clf", options.interpolation), points)
            return read.astype(np.float64)

        return predict

    return fit


def camera_match(size: int) -> Fit:
    """camera-match's LUT3D with its own settings."""
    lut3d = importlib.import_module("camera_match").LUT3D

    def fit(x: Array, y: Array) -> Predictor:
        node = lut3d(size=size)
        node.solve(x, y)
        return lambda points: np.asarray(node(points), dtype=np.float64)

    return fit


def figures(fit: Fit, x: Array, y: Array, seed: int) -> tuple[float, float, float, float]:
    """Mean, 95th percentile and maximum of one split, and the seconds of the fit: the least of a few repeats."""
    order = np.random.default_rng(seed).permutation(len(x))
    inside, outside = order[: int(0.7 * len(x))], order[int(0.7 * len(x)) :]
    seconds: list[float] = []
    while len(seconds) < REPEATS and sum(seconds) < LONG:
        start = time.perf_counter()
        predict = fit(x[inside], y[inside])
        seconds.append(time.perf_counter() - start)
    error = np.linalg.norm(np.clip(predict(x[outside]), 0, 1) - y[outside], axis=1)
    return float(error.mean()), float(np.quantile(error, 0.95)), float(error.max()), min(seconds)


def held_out(fit: Fit, x: Array, y: Array) -> Array:
    """Those four of each split, (splits, 4)."""
    return np.array([figures(fit, x, y, seed) for seed in SEEDS])


def send_camera_match(pipe: Connection, size: int, x: Array, y: Array, seed: int) -> None:
    """What a process of its own does: say that it is ready, then the figures of a split."""
    fit = camera_match(size)
    pipe.send(None)
    pipe.send(figures(fit, x, y, seed))


def held_out_camera_match(size: int, x: Array, y: Array) -> Array | None:
    """The same of camera-match; None where a fit is not done in LIMIT seconds, or dies: then no other is tried."""
    rows = []
    for seed in SEEDS:
        spawned = multiprocessing.get_context("spawn")
        mine, its = spawned.Pipe()
        process = spawned.Process(target=send_camera_match, args=(its, size, x, y, seed))
        process.start()
        its.close()
        mine.recv()
        try:
            row = mine.recv() if mine.poll(LIMIT) else None
        except EOFError:  # it died, of memory
            row = None
        process.kill()
        process.join()
        if row is None:
            return None
        rows.append(row)
    return np.array(rows)


def test_published_pairs(benchmark: BenchmarkFixture, shared_data: Path, tmp_path: Path) -> None:
    """The table of the README; LutForge is better than camera-match in every figure and size."""
    published = read_published_model(shared_data / "nus_nikon_d40" / "other_white_balances")
    x, y = published.balanced, published.encoded
    peer = importlib.util.find_spec("camera_match") is not None

    def rbf(fitted: Array, values: Array) -> Predictor:
        matrix, response = published.model.matrix, published.model.response
        h = RBFInterpolator(fitted @ matrix.T, response.linearize(values), kernel="linear", degree=1)
        return lambda points: response.encode(h(points @ matrix.T))

    found: dict[tuple[str, int], Array | None] = {}
    of_rbf: list[Array] = []

    def note(method: str, size: int, rows: Array | None) -> None:
        """Medians over the splits, and of the maximum over that of radial basis functions on the same split."""
        if rows is None:
            found[method, size] = None
            text = f"did not finish in {LIMIT:.0f} s | | | |"
        else:
            ratio = rows[:, 2] / (of_rbf or [rows])[0][:, 2]
            row = np.append(np.median(np.column_stack([rows[:, :3], ratio]), axis=0), rows[:, 3].min())
            found[method, size] = row
            text = "{:.4f} | {:.4f} | {:.3f} | {:.2f} | {:.3f}".format(*row)
        print(f"| {f'{size}³' if size else ''} | {method} | {text} |", flush=True)

    def measure() -> None:
        of_rbf.append(held_out(rbf, x, y))
        note("radial basis functions", 0, of_rbf[0])
        for size in SIZES:
            ours = CalibrationOptions(size=size)
            lattice(tmp_path, ours)(x[::3], y[::3])  # compiled before it is timed
            note("LutForge", size, held_out(lattice(tmp_path, ours), x, y))
            if size <= 33:
                thesis = replace(ours, preset="thesis")
                note("thesis preset", size, held_out(lattice(tmp_path, thesis), x, y))
            if peer:
                note("camera-match", size, held_out_camera_match(size, x, y))

    print("\n| size | method | mean | 95 % | max | max / RBF's | fit, s |\n|---|---|---|---|---|---|---|")
    benchmark.pedantic(measure, rounds=1)  # type: ignore[no-untyped-call]  # no types
    print(f"\nload {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for size in SIZES:
        theirs = found.get(("camera-match", size))
        mine = found["LutForge", size]
        assert mine is not None
        assert theirs is None or np.all(mine[:3] < theirs[:3]), size
    for form, size, most in LARGEST_MEANS:
        mine = found[form, size]
        assert mine is not None and mine[0] <= most and mine[3] <= LARGEST_RATIO, (form, size)
    idle = os.getloadavg()[0] <= 1.2 * (os.cpu_count() or 1)
    for size in SIZES:
        mine, theirs = found["LutForge", size], found.get(("camera-match", size))
        if mine is not None and theirs is not None:
            print(f"{size}³: {mine[-1] / theirs[-1]:.2f} of camera-match's time")
            assert not idle or mine[-1] <= theirs[-1], size


@pytest.mark.parametrize(("count", "size", "goal"), [(10_000, 24, 0.5), (1_000_000, 33, 2.0), (1_000_000, 65, 15.0)])
def test_speed(benchmark: BenchmarkFixture, count: int, size: int, goal: float) -> None:
    """Samples of a simulated camera: response, matrix, gamut maps and both lattices."""
    camera = nikon_d5100()
    gain = camera.multipliers("daylight")
    x = np.random.default_rng(0).random((count, 3)) ** 2
    y = camera.render(x / gain, "standard", "daylight")

    def fit() -> None:
        fit_lattices(style_of(x, y), CalibrationOptions(size=size))

    benchmark.pedantic(fit, rounds=3, warmup_rounds=1)  # type: ignore[no-untyped-call]  # no types
    assert benchmark.stats is not None
    seconds = benchmark.stats.stats.median
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    load = os.getloadavg()[0]
    print(f"\n{size}³ from {count}: {seconds:.2f} s (goal {goal}), peak {peak:.2f} GB, load {load:.1f}")
    assert peak < 1.5
    if load <= 1.2 * (os.cpu_count() or 1):
        assert seconds <= goal
