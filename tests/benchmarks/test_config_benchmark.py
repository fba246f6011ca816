"""How long programs wait for a config: run with `pytest tests/benchmarks/test_config_benchmark.py -s -n0`."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.profile_data import PictureStyle
from lutforge.model.white_balance import WhiteBalance
from lutforge.ocio.config import build_config

D40 = Path(__file__).parents[2] / "ocio_configs" / "nikon_d40" / "config.ocio"


def seconds(action: Callable[[], object], runs: int = 7) -> tuple[float, float]:
    """Median CPU and wall time of an action with empty caches."""
    cpu, wall = [], []
    for _ in range(runs):
        OCIO.ClearAllCaches()
        started, at = time.process_time(), time.perf_counter()
        action()
        cpu.append(time.process_time() - started)
        wall.append(time.perf_counter() - at)
    return statistics.median(cpu), statistics.median(wall)


def d40_processor() -> object:
    config = OCIO.Config.CreateFromFile(str(D40))
    return config.getProcessor("Nikon D40 standard tungsten", "ACEScg").getDefaultCPUProcessor()


def studio() -> object:
    config = OCIO.Config.CreateFromBuiltinConfig("studio-config-v5.0.0_aces-v2.1_ocio-v2.6")
    return config.getProcessor("ARRI LogC4", "ACEScg").getDefaultCPUProcessor()


def test_a_processor_of_the_d40() -> None:
    """Load and processor; beside it OpenColorIO's own studio config, of formulas alone, in the same run."""
    cpu, wall = seconds(d40_processor)
    peer_cpu, peer_wall = seconds(studio)
    size = sum(file.stat().st_size for file in D40.parent.rglob("*") if file.is_file())
    print(f"\nD40, 6 white balances, {size / 1e6:.2f} MB: {1e3 * cpu:.0f} ms CPU, {1e3 * wall:.0f} ms wall")
    print(f"studio config: {1e3 * peer_cpu:.0f} ms CPU, {1e3 * peer_wall:.0f} ms wall")
    assert size <= 4_000_000
    assert cpu <= 0.150


def test_many_cameras() -> None:
    """31 cameras × 4 styles × 7 white balances."""
    cube = uniform_levels(2)
    linear = PictureStyle(Lattice(cube, grid(cube)), Lattice(cube, grid(cube)))
    styles = dict.fromkeys(("standard", "vivid", "neutral", "landscape"), linear)
    names = ("daylight", "cloudy", "shade", "flash", "tungsten", "fluorescent", "auto")
    balances = {name: WhiteBalance((2.0 - 0.1 * k, 1.0, 1.5 + 0.1 * k)) for k, name in enumerate(names)}
    matrices = (np.eye(3) + 0.001 * number for number in range(31))
    profiles = [CameraProfile(f"Maker Model {k}", matrix, balances, styles) for k, matrix in enumerate(matrices)]
    text = build_config(profiles).serialize()
    cpu, wall = seconds(lambda: OCIO.Config.CreateFromStream(text))
    print(f"\n31 cameras × 4 styles × 7 white balances: loads in {cpu:.2f} s CPU, {wall:.2f} s wall")
    assert cpu <= 1.5
