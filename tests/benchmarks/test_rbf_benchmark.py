"""The gamut map: greedy fit of 4,000 centres from 100,000 samples, evaluation of a megapixel, and scipy beside.

    python -m pytest tests/benchmarks/test_rbf_benchmark.py --benchmark-only -s

The goals on two idle cores: fit ≤ 20 s with a peak below 2 GB, evaluation ≤ 0.8 s. scipy's RBFInterpolator (the same
kernel and degree) fits given centres only; it is timed on 4,000 of them, and evaluates a fiftieth of the pixels.
"""

import os
import resource
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.interpolate import RBFInterpolator

from lutforge.calibration.physical.gamut_map import GamutMapOptions, fit_gamut_map, solve

Array = NDArray[np.float64]

RNG = np.random.default_rng(0)
SOURCE = RNG.uniform(size=(100_000, 3))
TARGET = SOURCE + 0.08 * np.sin(5 * SOURCE[:, [1, 2, 0]]) * SOURCE + 0.002 * RNG.standard_normal(SOURCE.shape)
PIXELS = RNG.uniform(size=(1 << 20, 3))
CENTRES = 4000


def _timed(benchmark: BenchmarkFixture, task: Callable[[], Any], rounds: int) -> Any:
    """Run the task so often after a warm-up, where there is more than one round; its last answer."""
    return benchmark.pedantic(task, rounds=rounds, warmup_rounds=min(rounds - 1, 1))  # type: ignore[no-untyped-call]  # no types


def _median(benchmark: BenchmarkFixture) -> float:
    assert benchmark.stats is not None
    return float(benchmark.stats.stats.median)


def _idle() -> bool:
    """Whether the goals, which are for idle cores, can be held to: nobody else is computing."""
    return os.getloadavg()[0] <= 1.2 * (os.cpu_count() or 1)


pytestmark = pytest.mark.skipif("--benchmark-only" not in sys.argv, reason="run with --benchmark-only")


def test_greedy_fit(benchmark: BenchmarkFixture) -> None:
    fit = _timed(benchmark, lambda: fit_gamut_map(SOURCE, TARGET, GamutMapOptions(tolerance=1e-6, most=CENTRES)), 3)
    assert len(fit.gamut_map.centres) == CENTRES
    assert _median(benchmark) <= 20.0 or not _idle()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e9 if sys.platform == "darwin" else 1e6)
    print(f"\npeak memory of the process so far: {peak:.2f} GB")
    assert peak <= 2.0


def test_evaluation(benchmark: BenchmarkFixture) -> None:
    gamut_map = solve(SOURCE[:CENTRES], TARGET[:CENTRES], 1e-3)
    _timed(benchmark, lambda: gamut_map(PIXELS), 5)
    assert _median(benchmark) <= 0.8 or not _idle()


def test_scipy_fit(benchmark: BenchmarkFixture) -> None:
    centres, values = SOURCE[:CENTRES], TARGET[:CENTRES]
    _timed(benchmark, lambda: RBFInterpolator(centres, values, kernel="linear", degree=1, smoothing=1e-3), 1)


def test_scipy_evaluation_of_a_fiftieth(benchmark: BenchmarkFixture) -> None:
    scipy_map = RBFInterpolator(SOURCE[:CENTRES], TARGET[:CENTRES], kernel="linear", degree=1, smoothing=1e-3)
    pixels = PIXELS[::50]
    expected = _timed(benchmark, lambda: scipy_map(pixels), 1)
    ours = solve(SOURCE[:CENTRES], TARGET[:CENTRES], 1e-3)(pixels)
    np.testing.assert_allclose(ours, expected, atol=1e-4)
