"""How long programs wait for a config: run with `pytest tests/benchmarks/test_config_benchmark.py -s -n0`."""

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

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
