"""Baked files against those of `ociobakelut`, on the published Nikon D40 model.

    python -m pytest tests/benchmarks/test_bake_benchmark.py --benchmark-only -s    # all 12 transforms, and the table

Each LUT is measured as the file that was written, read back by OpenColorIO. The other side is the program itself, on a
config that holds the model in stages of 65³ nodes, with the best of six shapers and of both interpolations, as a .cube
with a shaper (it does not bake CLF); its errors are counted from the config's own transform, so that it is not charged
with what the config lacks. Ours, too, has the better of both interpolations.
"""

import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from lutforge.interpolation import INTERPOLATIONS
from lutforge.luts.bake import bake
from lutforge.luts.chain import bake_chain
from lutforge.luts.processor import evaluate, file_processor
from lutforge.luts.write import write_lut
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.colour_difference import delta_e_2000
from lutforge.model.published_model import import_published
from lutforge.model.transform import Transform

Array = NDArray[np.float64]

GAMMAS = (1.0, 1.5, 2.0, 2.4, 3.0)
LOG = "!<LogCameraTransform> {base: 2, log_side_slope: 0.1, log_side_offset: 1, lin_side_break: 0.00097656}"
"""The last ten stops, and a straight line below them."""
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


def config(transform: Transform, folder: Path) -> OCIO.CPUProcessor:
    """Write a config whose colour space "jpeg" is the transform, and others to shape with; what it makes of colours."""
    bake_chain(transform, 65).write(folder / "model.clf")
    spaces = [
        f"  - !<ColorSpace>\n    name: shaper{index}\n    from_scene_reference: {shape}\n"
        for index, shape in enumerate(
            [*(f"!<ExponentTransform> {{value: [{1 / g}, {1 / g}, {1 / g}, 1]}}" for g in GAMMAS), LOG]
        )
    ]
    (folder / "config.ocio").write_text(
        "ocio_profile_version: 2\nsearch_path: .\nroles: {default: raw}\ndisplays:\n  d:\n"
        "    - !<View> {name: v, colorspace: raw}\nactive_displays: []\nactive_views: []\ncolorspaces:\n"
        "  - !<ColorSpace> {name: raw, isdata: false}\n" + "".join(spaces) + "  - !<ColorSpace>\n    name: jpeg\n"
        "    from_scene_reference: !<FileTransform> {src: model.clf}\n"
    )
    return file_processor(folder / "model.clf")


def ociobakelut(size: int, folder: Path, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of the file of `ociobakelut`, at the best of its shapers and interpolations."""
    tool = Path(sys.executable).parent / "ociobakelut"
    if not tool.exists():
        pytest.skip("ociobakelut is not in this environment")
    errors = []
    for index in range(len(GAMMAS) + 1):
        command = [tool, "--iconfig", "config.ocio", "--inputspace", "raw", "--outputspace", "jpeg"]
        command += ["--format", "resolve_cube", "--cubesize", size]
        command += ["--shaperspace", f"shaper{index}", "--shapersize", 4096] if index else []
        subprocess.run([*map(str, command), "baked.cube"], cwd=folder, check=True, capture_output=True)
        for method in INTERPOLATIONS:
            got = evaluate(file_processor(folder / "baked.cube", method), x)
            error = delta_e_2000(got.astype(np.float64), wanted)
            errors.append((float(error.mean()), float(error.max())))
    return min(errors)


def written(transform: Transform, size: int, path: Path, x: Array, wanted: Array) -> tuple[float, float]:
    """Mean and maximum ΔE00 of our file, at the better of the two interpolations, each with its own fit."""
    errors = []
    for method in INTERPOLATIONS:
        file = write_lut(bake(transform, size, interpolation=method), path)
        error = delta_e_2000(evaluate(file_processor(file.path, method), x).astype(np.float64), wanted)
        errors.append((float(error.mean()), float(error.max())))
    return min(errors)


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
            given = evaluate(config(transform, tmp_path), x).astype(np.float64)
            row = []
            for ours, theirs in ((17, 33), (33, 65)):
                row += [
                    written(transform, ours, tmp_path / "a.clf", x, wanted),
                    ociobakelut(theirs, tmp_path, x, given),
                ]
                row.append(written(transform, ours, tmp_path / "a.resolve.cube", x, wanted))
            rows.append((name, row))

    benchmark.pedantic(all_of_them, rounds=1)  # type: ignore[no-untyped-call]  # pytest-benchmark has no types
    print(
        "\n| mean / max ΔE00 | ours 17³ .clf | .resolve.cube | ociobakelut 33³ | 33³ .clf | .resolve.cube | its 65³ |"
    )
    print("|---|---|---|---|---|---|---|")
    for name, (a, b, c, d, e, f) in rows:
        print("| " + " | ".join([name, *(f"{mean:.4f} / {most:.2f}" for mean, most in (a, c, b, d, f, e))]) + " |")
    for name, (a, b, _, d, e, _) in rows:
        for mine, theirs in ((a, b), (d, e)):
            assert mine[0] <= theirs[0], name
            assert mine[1] <= theirs[1], name


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
