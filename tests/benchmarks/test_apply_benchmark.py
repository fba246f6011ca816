"""Grading against OpenImageIO and OpenColorIO on the same LUT, images and threads; medians of alternating runs.

    python -m pytest tests/benchmarks/test_apply_benchmark.py --benchmark-only -s

Every round runs all sides one after the other, so that whatever else the machine does meets all of them. In memory,
on all sides into memory that is there: a 24-Mpixel float image with noise in it, so that neighbouring pixels look at
different nodes of the cube. Folders: 20 camera-like JPEG files of 12 Mpixel, with the quality and the chroma of the
output the same on both sides.
"""

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from statistics import median
from typing import TypeVar

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from lutforge.apply.blocks import apply_to_pixels
from lutforge.apply.grade import LutRecipe
from lutforge.images.read import read_image

THREADS = os.cpu_count() or 1
OIIOTOOL = Path(sys.executable).with_name("oiiotool")


@pytest.fixture(scope="module")
def cube(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """33³, with each channel dependent on all."""
    path = tmp_path_factory.mktemp("lut") / "look.cube"
    axis = np.linspace(0, 1, 33)
    blue, green, red = np.meshgrid(axis, axis, axis, indexing="ij")
    table = np.stack([red, green, blue], -1).reshape(-1, 3) ** 0.8 @ [[0.9, 0.1, 0], [0, 0.8, 0.2], [0.1, 0, 0.9]]
    path.write_text("LUT_3D_SIZE 33\n" + "\n".join(" ".join(f"{value:.6f}" for value in row) for row in table) + "\n")
    return path


def scene(height: int, width: int) -> NDArray[np.float32]:
    """Shades and surfaces as large as in photographs, with the noise of a sensor."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / width
    planes = [
        0.5 + 0.3 * np.sin(9 * x + c) * np.cos(7 * y - c) + 0.1 * (np.sin(60 * x * (c + 1)) > 0) for c in range(3)
    ]
    noisy = np.stack(planes, -1) + rng.normal(0, 0.01, (height, width, 3)).astype(np.float32)
    image: NDArray[np.float32] = np.clip(noisy, 0, 1).astype(np.float32)
    return image


Result = TypeVar("Result")


def once(benchmark: BenchmarkFixture, run: Callable[[], Result]) -> Result:
    result: Result = benchmark.pedantic(run, rounds=1)  # type: ignore[no-untyped-call]  # pytest-benchmark has no types
    return result


def alternating(sides: Mapping[str, Callable[[], object]], rounds: int) -> dict[str, list[float]]:
    seconds: dict[str, list[float]] = {name: [] for name in sides}
    for number in range(rounds + 1):
        for name, run in sides.items():
            began = time.perf_counter()
            run()
            if number:  # the first round fills caches
                seconds[name].append(time.perf_counter() - began)
    return seconds


def paired_ratio(seconds: dict[str, list[float]], peer: str) -> float:
    return median(theirs / ours for theirs, ours in zip(seconds[peer], seconds["lutforge"], strict=True))


def show(title: str, seconds: dict[str, list[float]], megapixels: float) -> None:
    print(f"\n{title}, {THREADS} threads, load average {os.getloadavg()[0]:.1f}")
    for name, values in seconds.items():
        ratio = "" if name == "lutforge" else f"   lutforge is {paired_ratio(seconds, name):.2f} times as fast"
        print(f"  {name:<34}{median(values):8.3f} s {megapixels / median(values):8.1f} Mpixel/s{ratio}")


@pytest.mark.parametrize("threads", sorted({1, THREADS}))
def test_in_memory(benchmark: BenchmarkFixture, cube: Path, threads: int) -> None:
    pixels = scene(4000, 6000)
    processor = LutRecipe(cube).grade(cube).processor
    buffer, theirs = oiio.ImageBuf(pixels), oiio.ImageBuf(pixels.copy())
    ours = pixels.copy()

    def blocked(size: int) -> Callable[[], object]:
        """OpenColorIO's best: nothing but blocks, in place, on an array that is there."""
        flat = pixels.copy().reshape(-1, 3)

        def run() -> object:
            with ThreadPoolExecutor(threads) as pool:
                return list(pool.map(lambda at: processor.applyRGB(flat[at : at + size]), range(0, len(flat), size)))

        return run

    sides: dict[str, Callable[[], object]] = {
        "lutforge": lambda: apply_to_pixels(processor, ours, workers=threads, out=ours),
        "OpenImageIO ociofiletransform": lambda: oiio.ImageBufAlgo.ociofiletransform(
            theirs, buffer, str(cube), nthreads=threads
        ),
        "OpenColorIO, blocks of 64 k, in place": blocked(64 * 1024),
        "OpenColorIO, blocks of 128 k, in place": blocked(128 * 1024),
    }
    seconds = once(benchmark, lambda: alternating(sides, 5))
    show(f"24 Mpixel of float RGB in memory ({threads} in use)", seconds, 24)
    np.testing.assert_allclose(apply_to_pixels(processor, pixels), np.asarray(theirs.get_pixels(oiio.FLOAT)), atol=1e-5)
    assert paired_ratio(seconds, "OpenImageIO ociofiletransform") >= 3
    assert min(paired_ratio(seconds, name) for name in sides if name.startswith("OpenColorIO")) >= 0.9


def test_folder_of_jpeg_files(benchmark: BenchmarkFixture, cube: Path, tmp_path: Path) -> None:
    if not OIIOTOOL.exists():
        pytest.skip("oiiotool is not in this environment")
    (tmp_path / "in").mkdir()
    pixels = scene(3000, 4000)
    for number in range(20):
        spec = oiio.ImageSpec(4000, 3000, 3, "uint8")
        spec.attribute("compression", "jpeg:92")
        path = tmp_path / "in" / f"f.{number:04d}.jpg"
        target = oiio.ImageOutput.create(str(path))
        assert target is not None
        assert target.open(str(path), spec)
        assert target.write_image(np.roll(pixels, 97 * number, axis=1))
        assert target.close()
    options = ["--ociofiletransform", str(cube), "--compression", "jpeg:97", "--attrib", "jpeg:subsampling", "4:4:4"]

    def lutforge() -> None:
        shutil.rmtree(tmp_path / "ours", ignore_errors=True)
        words = [
            sys.executable,
            "-m",
            "lutforge",
            "apply",
            str(cube),
            str(tmp_path / "in"),
            "-o",
            str(tmp_path / "ours"),
        ]
        subprocess.run(words, check=True, capture_output=True)

    def parallel_frames() -> None:
        words = [str(OIIOTOOL), "--parallel-frames", "--frames", "0-19", str(tmp_path / "in" / "f.%04d.jpg"), *options]
        subprocess.run([*words, "-o", str(tmp_path / "f.%04d.jpg")], check=True, capture_output=True)

    def loop() -> None:
        for path in sorted((tmp_path / "in").iterdir()):
            words = [str(OIIOTOOL), str(path), *options, "-o", str(tmp_path / path.name)]
            subprocess.run(words, check=True, capture_output=True)

    sides = {"lutforge": lutforge, "oiiotool --parallel-frames": parallel_frames, "a loop of oiiotool": loop}
    seconds = once(benchmark, lambda: alternating(sides, 2))
    show("20 JPEG files of 12 Mpixel", seconds, 240)
    ours, theirs = read_image(tmp_path / "ours" / "f.0003.jpg"), read_image(tmp_path / "f.0003.jpg")
    assert np.abs(ours.pixels - theirs.pixels).max() <= 2.5 / 255
    assert min(paired_ratio(seconds, name) for name in sides if name != "lutforge") >= 1.3


@pytest.mark.parametrize(
    ("kind", "compression", "tile"),
    [("uint16", "none", 0), ("uint16", "zip", 0), ("uint16", "zip", 256), ("float", "zip", 0)],
)
def test_memory_of_200_megapixels(
    benchmark: BenchmarkFixture, cube: Path, tmp_path: Path, kind: str, compression: str, tile: int
) -> None:
    side, step = 14142, 256
    suffix = ".exr" if kind == "float" else ".tif"
    spec = oiio.ImageSpec(side, side, 3, kind)
    spec.tile_width = spec.tile_height = tile
    spec.attribute("compression", compression)
    target = oiio.ImageOutput.create(f"a{suffix}")
    assert target is not None
    assert target.open(str(tmp_path / f"a{suffix}"), spec)
    ramp = np.linspace(0, 1, side, dtype=np.float32)
    for top in range(0, side, step):
        bottom = min(top + step, side)
        strip = np.empty((bottom - top, side, 3), np.float32)
        strip[..., 0], strip[..., 1], strip[..., 2] = ramp, ramp[::-1], top / side
        if tile:
            assert target.write_tiles(0, side, top, bottom, 0, 1, strip)
        else:
            assert target.write_scanlines(top, bottom, 0, strip)
    assert target.close()
    code = (
        "import sys\nfrom lutforge.cli.main import main\ntry:\n    main()\nfinally:\n"
        "    text = open('/proc/self/status').read()\n    print('peak', text.split('VmHWM:')[1].split()[0])"
    )
    words = [sys.executable, "-c", code, "apply", str(cube), str(tmp_path / f"a{suffix}"), "-o", str(tmp_path / "out")]
    run = once(benchmark, lambda: subprocess.run(words, capture_output=True, text=True, check=True))
    peak = int(run.stdout.split("peak")[1]) / 1024
    print(f"\n200 Mpixel, {kind}, {compression}, {f'tiles of {tile}' if tile else 'scanlines'}: peak {peak:.0f} MB")
    assert peak <= 600
