"""Baked files against sampling at the nodes, which is what `ociobakelut` does, on the published Nikon D40 model.

    python -m pytest tests/benchmarks/test_bake_benchmark.py --benchmark-only -s    # all 12 transforms, and the table

Each LUT is measured as the file that was written, read back by OpenColorIO. The other side samples the exact model at
the nodes in float64, with the best of six shapers and of both interpolations, which flatters it.
"""

import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from lutforge.interpolation import INTERPOLATIONS, interpolate
from lutforge.luts.bake import bake
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.write import write_lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.colour_difference import delta_e_2000
from lutforge.model.lattice import grid
from lutforge.model.published_model import import_published
from lutforge.model.transform import Transform

Array = NDArray[np.float64]

SHAPERS: dict[str, Callable[[Array], Array]] = {
    "none": lambda u: u,
    "gamma 1.5": lambda u: u**1.5,
    "gamma 2": lambda u: u**2,
    "gamma 2.4": lambda u: u**2.4,
    "gamma 3": lambda u: u**3,
    "10 stops of log": lambda u: np.asarray((2 ** (10 * u) - 1) / 1023),
}
REFINISHES = (
    ("tungsten", "daylight", 0.0),
    ("daylight", "tungsten", 0.0),
    ("shade", "daylight", 0.0),
    ("daylight", "shade", 0.5),
    ("cloudy", "flash", -0.5),
    ("daylight", "daylight", 0.7),
)
RENDERS = ("daylight", "tungsten", "shade", "cloudy", "flash", "fluorescent")


@pytest.fixture(scope="module")
def profile(shared_data: Path) -> CameraProfile:
    folder = shared_data / "nus_nikon_d40"
    return import_published([folder / "other_white_balances", folder / "fluorescent"], "Nikon D40")


def transforms(profile: CameraProfile) -> dict[str, Transform]:
    found = {f"render {name}": profile.render(f"standard/{name}") for name in RENDERS}
    for source, target, ev in REFINISHES:
        refinish = profile.refinish(f"standard/{source}", f"standard/{target}", ev)
        found[f"refinish {source} to {target} {ev:+g} EV"] = refinish
    return found


def colours() -> Array:
    grey = np.repeat(np.linspace(0, 1, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    x = np.concatenate([np.random.default_rng(3).random((30000, 3)), grey, corners])
    return x.astype(np.float32).astype(np.float64)


def sampled(transform: Transform, size: int, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of a cube sampled at its nodes, each at the best of shapers and interpolations."""
    means, largest = [], []
    for shape in SHAPERS.values():
        axis = shape(np.linspace(0.0, 1.0, size))
        levels = (axis, axis, axis)
        values = transform(grid(levels))
        for method in INTERPOLATIONS:
            error = delta_e_2000(interpolate(x, levels, values, method), wanted)
            means.append(float(error.mean()))
            largest.append(float(error.max()))
    best = int(np.argmin(means))
    return means[best], largest[best]


def written(transform: Transform, size: int, path: Path, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of our file."""
    file = write_lut(bake(transform, size), path)
    error = delta_e_2000(evaluate(file_processor(file.path), x).astype(np.float64), wanted)
    return float(error.mean()), float(error.max())


def test_a_third_of_the_nodes_is_enough(
    profile: CameraProfile, tmp_path: Path, request: pytest.FixtureRequest, benchmark: BenchmarkFixture
) -> None:
    """17³ of ours against 33³ of theirs, 33³ against 65³; all with --benchmark-only, else one of each kind."""
    chosen = transforms(profile)
    if not request.config.getoption("benchmark_only"):
        chosen = {name: chosen[name] for name in list(chosen)[::9]}
    x = colours()
    rows = []

    def all_of_them() -> None:
        for name, transform in chosen.items():
            wanted = transform(x)
            row = []
            for ours, theirs in ((17, 33), (33, 65)):
                row += [written(transform, ours, tmp_path / "a.clf", x, wanted), sampled(transform, theirs, x, wanted)]
                row.append(written(transform, ours, tmp_path / "a.resolve.cube", x, wanted))
            rows.append((name, row))

    benchmark.pedantic(all_of_them, rounds=1)  # type: ignore[no-untyped-call]  # pytest-benchmark has no types
    print("\n| mean / max ΔE00 | ours 17³ .clf | 17³ .cube | sampled 33³ | ours 33³ .clf | 33³ .cube | sampled 65³ |")
    print("|---|---|---|---|---|---|---|")
    for name, (a, b, c, d, e, f) in rows:
        print("| " + " | ".join([name, *(f"{mean:.4f} / {most:.2f}" for mean, most in (a, c, b, d, f, e))]) + " |")
    for name, (a, b, _, d, e, _) in rows:
        for mine, theirs in ((a, b), (d, e)):
            assert mine[0] <= theirs[0], name
            assert mine[1] <= theirs[1], name


def test_sampling_at_the_nodes_is_what_ociobakelut_does(profile: CameraProfile, tmp_path: Path) -> None:
    lut = bake(profile.render("standard/daylight"), 17)
    write_lut(lut, tmp_path / "render.clf")
    (tmp_path / "config.ocio").write_text(
        "ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw}\ndisplays:\n  d:\n"
        "    - !<View> {name: v, colorspace: raw}\nactive_displays: []\nactive_views: []\ncolorspaces:\n"
        "  - !<ColorSpace> {name: raw, isdata: false}\n"
        "  - !<ColorSpace>\n    name: jpeg\n    from_scene_reference: !<FileTransform> {src: render.clf}\n"
    )
    tool = Path(sys.executable).parent / "ociobakelut"
    if not tool.exists():
        pytest.skip("ociobakelut is not in this environment")
    command = [tool, "--iconfig", "config.ocio", "--inputspace", "raw", "--outputspace", "jpeg"]
    command += ["--format", "iridas_cube", "--cubesize", "9", "baked.cube"]
    subprocess.run(list(map(str, command)), cwd=tmp_path, check=True, capture_output=True)
    axis = np.linspace(0, 1, 9)
    nodes = grid((axis, axis, axis)).reshape(-1, 3)
    at_nodes = evaluate(file_processor(tmp_path / "baked.cube"), nodes)
    np.testing.assert_allclose(at_nodes, lut(nodes), atol=2e-5)


@pytest.mark.parametrize(("size", "seconds"), [(33, 1.0), (65, 4.0)])
def test_a_refinish_is_baked_and_written_in_time(
    profile: CameraProfile,
    tmp_path: Path,
    size: int,
    seconds: float,
    request: pytest.FixtureRequest,
    benchmark: BenchmarkFixture,
) -> None:
    """The model with 3,018 centres each way, to .clf and to .cube. The limit is asserted with --benchmark-only."""
    transform = profile.refinish("standard/tungsten", "standard/daylight")
    bake(transform, 5).write(tmp_path / "warm.cube")  # compiled code is loaded once

    def bake_and_write() -> None:
        begin = time.perf_counter()
        lut = bake(transform, size)
        write_lut(lut, tmp_path / "a.clf")
        middle = time.perf_counter()
        write_lut(lut, tmp_path / "a.resolve.cube")
        end = time.perf_counter()
        took.append(end - begin)
        print(f"\n{size}³: baked and .clf {middle - begin:.2f} s, .cube fitted and written {end - middle:.2f} s")

    took: list[float] = []
    only = bool(request.config.getoption("benchmark_only"))
    benchmark.pedantic(bake_and_write, rounds=3 if only else 1)  # type: ignore[no-untyped-call]  # as above
    if only:
        assert min(took) < seconds
