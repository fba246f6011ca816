"""Baked files against those of `ociobakelut` on the published Nikon D40, and how long a bake takes.

    python -m pytest tests/benchmarks/test_bake_benchmark.py --benchmark-only -s    # all 12 transforms, and the table

What is compared, and the table alone, in a run that can be broken off: `bake_table.py`.
"""

import sys
import time
from pathlib import Path

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from lutforge.luts.bake import bake_forms
from lutforge.luts.programs import target_of
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.baking import bake
from tests.benchmarks.bake_table import colours, nikon_d40, ours, table, theirs, transforms


@pytest.fixture(scope="module")
def profile(shared_data: Path) -> CameraProfile:
    return nikon_d40(shared_data)


def test_a_third_of_the_nodes_is_enough(
    profile: CameraProfile, tmp_path: Path, request: pytest.FixtureRequest, benchmark: BenchmarkFixture
) -> None:
    """17³ of ours against 33³ of theirs, 33³ against 65³; all with --benchmark-only, else one of each kind."""
    if not (Path(sys.executable).parent / "ociobakelut").exists():
        pytest.skip("ociobakelut is not in this environment")
    chosen = transforms(profile)
    if not request.config.getoption("benchmark_only"):
        chosen = {name: chosen[name] for name in list(chosen)[::9]}
    rows = {}

    def all_of_them() -> None:
        for name, transform in chosen.items():
            peer = theirs(transform, tmp_path, (33, 65), (".cube",))
            mine = ours(transform, tmp_path, (17, 33), (".clf", ".cube"))
            rows[name] = {f"ours {key}": value for key, value in mine.items()}
            rows[name] |= {f"theirs {key}": value for key, value in peer.items()}

    benchmark.pedantic(all_of_them, rounds=1)  # type: ignore[no-untyped-call]  # pytest-benchmark has no types
    print("\n" + table(rows))
    for name, errors in rows.items():
        for size, larger in ((17, 33), (33, 65)):
            assert errors[f"ours .clf {size}"][0] <= errors[f"theirs .cube {larger}"][0], name
            assert errors[f"ours .clf {size}"][1] <= errors[f"theirs .cube {larger}"][1], name


def test_stages_beside_one_cube(profile: CameraProfile, benchmark: BenchmarkFixture) -> None:
    """Matrix, shaper, cube of h only and response at 17³ beside one cube of everything at 33³, RGB errors.

    One cube is uniform, as programs write it; or has our shaper. For linearize the latter is no other form: f⁻¹ is the
    shaper and the matrix is in the nodes, so that its 33³ has all that the stages have, and eight times the nodes.
    """
    x = colours()
    chosen = {"render": profile.render("standard/daylight"), "linearize": profile.linearize("standard/daylight")}
    rows: dict[str, list[tuple[float, float]]] = {}

    def all_of_them() -> None:
        for name, transform in chosen.items():
            one = (bake(transform, size=33, form="plain"), bake(transform, size=33, form="shaper"))
            luts = (bake(transform, size=17), *one)
            errors = [np.linalg.norm(lut(x) - transform(x), axis=1) for lut in luts]
            rows[name] = [(float(error.mean()), float(error.max())) for error in errors]

    benchmark.pedantic(all_of_them, rounds=1)  # type: ignore[no-untyped-call]  # pytest-benchmark has no types
    print("\n| mean / max RGB error | stages 17³ | one uniform cube 33³ | 33³ with our shaper |\n|---|---|---|---|")
    for name, errors in rows.items():
        print(f"| {name} | " + " | ".join(f"{mean:.2g} / {most:.2g}" for mean, most in errors) + " |")
        staged, uniform, shaped = errors
        assert staged[0] < 0.5 * uniform[0]
        assert staged[1] < 0.5 * uniform[1]
        if name == "render":
            assert staged[0] < 0.5 * shaped[0]


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
    bake(transform, tmp_path / "warm.cube", size=5)  # compiled code is loaded once

    def bake_and_write() -> None:
        begin = time.perf_counter()
        paths = [tmp_path / "a.clf", tmp_path / "a.resolve.cube"]
        luts = bake_forms(transform, [target_of(path, None, size) for path in paths])
        middle = time.perf_counter()
        for lut, path in zip(luts, paths, strict=True):
            lut.write(path)
        end = time.perf_counter()
        took.append(end - begin)
        print(f"\n{size}³: baked for .clf and .cube {middle - begin:.2f} s, written {end - middle:.2f} s")

    took: list[float] = []
    only = bool(request.config.getoption("benchmark_only"))
    benchmark.pedantic(bake_and_write, rounds=3 if only else 1)  # type: ignore[no-untyped-call]  # as above
    if only:
        assert min(took) < seconds
