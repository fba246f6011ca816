"""How long people wait and what it takes of memory, with the limit beside each figure, on an idle machine of two cores.

    python -m tests.benchmarks.speed [--only WORD …] [--json FILE] [--compare FILE]

Whole commands run in processes of their own, and so do parts of them (`TASKS`); a figure is the median of three runs
after one that fills caches. What is compared with another program runs in turn with it, so that whatever else the
machine does meets both. The real data of `LUTFORGE_TEST_DATA` make the lines that need them; all else is made here.
The whole table takes about half an hour.
"""

import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import psutil
from PIL import Image as Pillow

from lutforge.arrays import Single
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.style import fit_lattices
from lutforge.luts.bake import bake_to
from lutforge.luts.target import target_of
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from lutforge.thesis.gamut_map import fit_gamut_map
from tests.benchmarks import common
from tests.benchmarks.common import ROOT, Figure, Figures, Parts
from tests.cases.pictures import write_cube
from tests.cases.real_data import read_published_pairs
from tests.cases.samples import style_of

BARE = """
import os, sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
{}
lut, out, *files = sys.argv[1:]
Path(out).mkdir(exist_ok=True)
def apply(processor, pixels, block):
    flat = pixels.reshape(-1, 3)
    for at in range(0, len(flat), block):
        processor.applyRGB(flat[at : at + block])
{}
with ThreadPoolExecutor(os.cpu_count()) as pool:
    list(pool.map(work, files))
"""
"""What libraries alone do of a LUT, a folder of outputs and files, in place of a command."""
READ = 'read = OCIO.Config.CreateRaw().getProcessor(OCIO.FileTransform(lut, "", OCIO.INTERP_TETRAHEDRAL))'
BARE_JPEG = BARE.format(
    "import PyOpenColorIO as OCIO, simplejpeg",
    f"""
{READ}
code = OCIO.BIT_DEPTH_UINT8
processor = read.getOptimizedCPUProcessor(code, code, OCIO.OPTIMIZATION_DEFAULT)
def work(file):
    pixels = simplejpeg.decode_jpeg(Path(file).read_bytes())
    apply(processor, pixels, 1 << 14)
    Path(out, Path(file).name).write_bytes(simplejpeg.encode_jpeg(pixels, 93, colorsubsampling="422"))
""",
)
BARE_FLOAT = BARE.format(
    "import OpenImageIO as oiio, PyOpenColorIO as OCIO",
    f"""
oiio.attribute("threads", 1)
{READ}
processor = read.getDefaultCPUProcessor()
def work(file):
    source = oiio.ImageInput.open(file)
    spec, pixels = source.spec(), source.read_image(oiio.FLOAT)
    apply(processor, pixels, 1 << 16)
    target = oiio.ImageOutput.create(file)
    target.open(str(Path(out, Path(file).name)), spec)
    target.write_image(pixels)
    target.close()
""",
)
BARE_RAW = BARE.format(
    "import rawpy",
    """
def work(file):
    with rawpy.imread(file) as raw:
        raw.postprocess(half_size=True, gamma=(1, 1), output_color=rawpy.ColorSpace.raw, user_wb=[1, 1, 1, 1],
                        no_auto_bright=True, adjust_maximum_thr=0, output_bps=16, user_flip=0)
""",
)


@dataclass(frozen=True)
class Ran:
    """A run of a command: its time, the most memory that it held, the time of all processors, and what it printed."""

    seconds: float
    megabytes: float
    processor: float
    printed: str


def run(*words: object, **environment: str) -> Ran:
    """Run a command with the package of this folder. Raises RuntimeError where it fails."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), **environment}
    env.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    before, began, most = os.times(), time.perf_counter(), 0.0
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as errors:
        command = psutil.Popen(list(map(str, words)), env=env, stdout=out, stderr=errors)
        waiting = threading.Thread(target=command.wait)
        waiting.start()
        while waiting.is_alive():
            waiting.join(0.02)
            with suppress(psutil.Error):
                most = max(most, command.memory_info().rss / 2**20)
        seconds, after = time.perf_counter() - began, os.times()
        for file in (out, errors):
            file.seek(0)
        printed, complaint = out.read().decode(), errors.read().decode("utf-8", "replace")
    if command.returncode:
        last = " ".join(complaint.strip().splitlines()[-1:])
        raise RuntimeError(f"it ended with status {command.returncode}: {last[:200]}")
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return Ran(seconds, most, processor, printed)


def lutforge(*words: object, **environment: str) -> Ran:
    return run(sys.executable, "-m", "lutforge", *words, **environment)


def alternating(*sides: Callable[[], Ran], rounds: int = 3) -> list[list[Ran]]:
    """The runs of each side, one after the other in each round; a round before them fills caches."""
    runs = [[side() for side in sides] for _ in range(rounds + 1)][1:]
    return [list(side) for side in zip(*runs, strict=True)]


def ratio(first: list[Ran], second: list[Ran]) -> float:
    """The median of how many times as long one side takes as the other."""
    return median(a.seconds / b.seconds for a, b in zip(first, second, strict=True))


def timed(name: str, limit: float, run_once: Callable[[], Ran]) -> Figure:
    """The time of a command; seconds of all processors are told too, which other work on the machine changes less."""
    (runs,) = alternating(run_once)
    seconds, processor = median(ran.seconds for ran in runs), median(ran.processor for ran in runs)
    return Figure(name, seconds, limit, "s", note=f"  processor {processor:.2f} s", compared=False)


def lattice_task(size: int, count: int) -> Callable[[], object]:
    """Samples of a simulated camera: response, matrix, gamut maps and both lattices, with the search of levels."""
    camera = nikon_d5100()
    x = np.random.default_rng(0).random((count, 3)) ** 2
    y = camera.render(x / camera.multipliers("daylight"), "standard", "daylight")
    return lambda: fit_lattices(style_of(x, y), CalibrationOptions(size=size))


def gamut_map_task(centres: int, count: int) -> Callable[[], object]:
    """A greedy fit of so many centres from so many samples."""
    rng = np.random.default_rng(0)
    source = rng.uniform(size=(count, 3))
    target = source + 0.08 * np.sin(5 * source[:, [1, 2, 0]]) * source + 0.002 * rng.standard_normal(source.shape)
    return lambda: fit_gamut_map(source, target, tolerance=1e-6, most=centres)


def bake_task(size: int, _: int) -> Callable[[], object]:
    """A refinish of the D40's published model, with 3,018 centres each way, baked and written as .clf and .cube."""
    data, folder = common.real_data(), Path(tempfile.mkdtemp())
    assert data is not None
    transform = common.nikon_d40(data).refinish("standard/tungsten", "standard/daylight")
    paths = [folder / "a.clf", folder / "a.resolve.cube"]
    targets = [target_of(path, None, size) for path in paths]
    return lambda: [
        lut.write(path) for lut, path in zip([bake_to(transform, target) for target in targets], paths, strict=True)
    ]


TASKS = {"lattice": lattice_task, "gamut map": gamut_map_task, "bake": bake_task}


def task(name: str, size: int, count: int, title: str, limit: float, megabytes: float) -> Figures:
    """A task in a process of its own: the median of its times there, and the most memory that the process holds."""
    ran = run(sys.executable, "-m", "tests.benchmarks.speed", "--task", name, size, count)
    yield Figure(title, float(ran.printed), limit, "s", compared=False)
    yield Figure(f"{title}: memory", ran.megabytes, megabytes, "MB")


def run_task(name: str, size: int, count: int) -> None:
    """Print the median of three times of a task, after a run that compiles and fills caches."""
    once, seconds = TASKS[name](size, count), []
    for _ in range(4):
        began = time.perf_counter()
        once()
        seconds.append(time.perf_counter() - began)
    print(median(seconds[1:]))


def task_lines() -> Figures:
    for size, count, limit in ((24, 10_000, 0.5), (33, 1_000_000, 2.0), (65, 1_000_000, 15.0)):
        yield from task("lattice", size, count, f"lattice {size}³ from {count:,} samples", limit, 1500)
    yield from task("gamut map", 4000, 100_000, "gamut map of 4,000 centres from 100,000 samples", 20.0, 2000)
    if common.real_data() is not None:
        for size, limit in ((33, 1.0), (65, 4.0)):
            yield from task("bake", size, 0, f"refinish of the D40 baked and written, {size}³", limit, 2000)


def scene(height: int, width: int) -> Single:
    """Shades, edges and the noise of a sensor, so that neighbouring pixels look at different nodes of a cube."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / width
    waves = [0.5 + 0.3 * np.sin(9 * x + c) * np.cos(7 * y - c) for c in range(3)]
    edges = [0.1 * (np.sin(60 * x * (c + 1)) > 0) for c in range(3)]
    noisy = np.stack(waves, -1) + np.stack(edges, -1) + rng.normal(0, 0.01, (height, width, 3))
    return np.asarray(np.clip(noisy, 0, 1), dtype=np.float32)


def write_float(path: Path, side: tuple[int, int], kind: str, compression: str, tile: int = 0) -> Path:
    """A picture of the scene's strip, again and again, written as cameras' programs do: in strips or in tiles."""
    (height, width), step = side, 256
    spec = oiio.ImageSpec(width, height, 3, kind)
    spec.tile_width = spec.tile_height = tile
    spec.attribute("compression", compression)
    target = oiio.ImageOutput.create(str(path))
    assert target is not None
    assert target.open(str(path), spec)
    strip = scene(step, width)
    for top in range(0, height, step):
        bottom = min(top + step, height)
        rows = strip[: bottom - top]
        if tile:
            assert target.write_tiles(0, width, top, bottom, 0, 1, rows)
        else:
            assert target.write_scanlines(top, bottom, 0, rows)
    assert target.close()
    return path


def jpegs(folder: Path, count: int, height: int, width: int) -> list[Path]:
    folder.mkdir()
    codes = np.rint(255 * scene(height, width)).astype(np.uint8)
    paths = [folder / f"{number:04d}.jpg" for number in range(count)]
    for number, path in enumerate(paths):
        Pillow.fromarray(np.roll(codes, 97 * number, axis=1)).save(path, quality=93, subsampling=1)
    return paths


def beside_a_bare_script(name: str, code: str, lut: Path, files: list[Path], share: float) -> Figures:
    place = files[0].parent.parent
    ours, bare = alternating(
        lambda: lutforge("apply", lut, files[0].parent, "-o", place / "ours"),
        lambda: run(sys.executable, "-c", code, lut, place / "bare", *files),
    )
    yield Figure(f"{name}: speed, of a bare script's", ratio(bare, ours), share, at_least=True, compared=False)
    yield Figure(f"{name}: memory", median(ran.megabytes for ran in ours), 400, "MB")


def jpeg_lines(folder: Path, lut: Path) -> Figures:
    yield from beside_a_bare_script("12 JPEG of 24 Mpixel", BARE_JPEG, lut, jpegs(folder / "l", 12, 4000, 6000), 0.85)
    small = jpegs(folder / "s", 200, 1154, 1732)
    yield from beside_a_bare_script("200 JPEG of 2 Mpixel", BARE_JPEG, lut, small, 0.85)


def float_lines(folder: Path, lut: Path) -> Figures:
    for suffix, kind, compression in ((".tif", "uint16", "none"), (".exr", "half", "zip")):
        files = [folder / suffix[1:] / f"{number}{suffix}" for number in range(6)]
        files[0].parent.mkdir()
        write_float(files[0], (3000, 4000), kind, compression)
        for path in files[1:]:
            path.hardlink_to(files[0])
        yield next(beside_a_bare_script(f"6 {suffix} of 12 Mpixel", BARE_FLOAT, lut, files, 0.9))
    side = (14142, 14142)
    for suffix, kind, compression, tile in (
        (".tif", "uint16", "none", 0), (".tif", "uint16", "zip", 0), (".tif", "uint16", "zip", 256),
        (".exr", "float", "zip", 0),
    ):  # fmt: skip
        with tempfile.TemporaryDirectory() as place:
            path = write_float(Path(place) / f"large{suffix}", side, kind, compression, tile)
            ran = lutforge("apply", lut, path, "-o", Path(place) / "out")
        name = f"200 Mpixel, {suffix} {compression}, {f'tiles of {tile}' if tile else 'scanlines'}: memory"
        yield Figure(name, ran.megabytes, 600, "MB")


def start_lines(folder: Path, lut: Path, profile: Path) -> Figures:
    (picture,) = jpegs(folder / "one", 1, 600, 800)
    yield timed("start: lutforge --help", 0.25, lambda: lutforge("--help"))
    yield timed("start: inspect a profile", 0.25, lambda: lutforge("inspect", profile))
    one = "start: apply a LUT to one small JPEG"
    yield timed(one, 0.35, lambda: lutforge("apply", lut, picture, "-o", folder / "out"))


def raw_lines(folder: Path, lut: Path, count: int = 60) -> Figures:
    """One simulated photograph under many names. It is not compressed: cameras' files take LibRaw twice the time."""
    camera, shots = nikon_d5100(), folder / "raw"
    shots.mkdir()
    settings = CameraSettings("standard", "daylight", camera.nominal_exposure_s)
    first = photograph(camera, SCENES["wall"](4000, 6000, 0), settings, folder, "first", jpeg_beside=False).dng
    files = [shots / f"{number:03d}.dng" for number in range(count)]
    for path in files:
        path.hardlink_to(first)
    ours, bare = alternating(
        lambda: lutforge("sample", shots, "-o", folder / "samples_of_raw.csv"),
        lambda: run(sys.executable, "-c", BARE_RAW, lut, folder / "bare", *files),
        rounds=2,
    )
    yield Figure(f"sample {count} RAW of 24 Mpixel: time, of their decoding's", ratio(ours, bare), 1.3, compared=False)


def fit_lines(folder: Path, table: Path, profile: Path) -> Figures:
    data = common.real_data()
    if data is not None:
        shots = sorted((data / "canon_powershot_s40").glob("*.CRW"))
        yield timed("calibrate: five RAW files", 4.0, lambda: lutforge("calibrate", *shots, "-o", folder / "s40.npz"))
    many = "calibrate: 5,000 samples, with held-out errors"
    yield timed(many, 2.0, lambda: lutforge("calibrate", table, "-o", folder / "c.npz"))
    yield timed("config of one style", 4.0, lambda: lutforge("config", profile, "-o", folder / "ocio", "--replace"))
    yield from config_of_many(folder, load_profile(profile))


def config_of_many(folder: Path, profile: CameraProfile, cameras: int = 2) -> Figures:
    """A config of cameras with four styles each, beside two bakes a camera."""
    (style,) = profile.styles.values()
    four = {f"style {number}": style for number in range(4)}
    paths = [folder / f"camera_{number}.npz" for number in range(cameras)]
    for path in paths:
        replace(profile, camera=path.stem, styles=four).save(path)
    words = ("render", "--to", "style 0/daylight", "-o", folder / "baked.cube")
    whole, one = alternating(
        lambda: lutforge("config", *paths, "-o", folder / "ocio_of_many", "--replace"),
        lambda: lutforge("bake", paths[0], *words),
    )
    name = f"config of {cameras} cameras with 4 styles: bakes' time"
    yield Figure(name, ratio(whole, one), 2.0 * cameras, compared=False)


def demo_lines(folder: Path) -> Figures:
    cache = {"XDG_CACHE_HOME": str(folder / "cache"), "NUMBA_CACHE_DIR": ""}
    first, again = (lutforge("demo", "-o", folder / "demo", **cache) for _ in range(2))
    yield Figure("demo", again.seconds, 45.0, "s", note=f"  processor {again.processor:.2f} s", compared=False)
    longer = first.seconds - again.seconds
    yield Figure("demo: the first run, with no kernel compiled, longer by", longer, 15.0, "s", compared=False)


def cluster_lines(folder: Path, lut: Path) -> Figures:
    from distributed import LocalCluster as Cluster

    cluster: Any = Cluster  # Dask has no types

    files = jpegs(folder / "c", 240, 2000, 3000)
    with (
        cluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as one,
        cluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as two,
    ):

        def graded_by(address: str) -> Callable[[], Ran]:
            return lambda: lutforge("apply", lut, files[0].parent, "-o", folder / "farm", "--scheduler", address)

        alone, both = alternating(graded_by(one.scheduler_address), graded_by(two.scheduler_address))
    name = "Dask: 240 JPEG of 6 Mpixel, two workers of one's speed"
    yield Figure(name, ratio(alone, both), 1.8, at_least=True, compared=False)


def samples_of_the_d40(count: int) -> SampleSet:
    """The published pairs of the Nikon D40, again with a little noise, in ten shots."""
    pairs, rng = read_published_pairs(), np.random.default_rng(0)
    gain, rows = np.array(pairs.multipliers["daylight"]), rng.integers(0, len(pairs.encoded), count)
    raw = np.clip(pairs.balanced[rows] / gain + rng.normal(0, 0.001, (count, 3)), 0, 1)
    shot = [f"shot {number % 10}" for number in range(count)]
    return SampleSet.from_arrays(
        raw, pairs.encoded[rows], camera="Nikon D40", white_balance="daylight", shot=shot, exposure_s=1.0, wb=gain
    )


def parts(folder: Path) -> Parts:
    """The parts of the table, by the words that ask for them."""
    lut, table, profile = write_cube(folder / "look.cube"), folder / "samples.csv", folder / "camera.npz"
    samples_of_the_d40(5000).save(table)
    calibrate(read_samples(table))[0].save(profile)
    return {
        "start": lambda: start_lines(folder, lut, profile),
        "calibrate config": lambda: fit_lines(folder, table, profile),
        "tasks": task_lines,
        "jpeg": lambda: jpeg_lines(folder, lut),
        "tif exr": lambda: float_lines(folder, lut),
        "raw": lambda: raw_lines(folder, lut),
        "dask": lambda: cluster_lines(folder, lut),
        "demo": lambda: demo_lines(folder),
    }


def main() -> int:
    """Print the figures, or the time of a task."""
    parser = common.parser(__doc__)
    parser.add_argument("--task", nargs=3, help="a task, its size and its count: its time in this process")
    arguments = parser.parse_args()
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}", file=sys.stderr)
    if arguments.task:
        name, size, count = arguments.task
        run_task(name, int(size), int(count))
        return 0
    return common.measured(parts, arguments)


if __name__ == "__main__":
    sys.exit(main())
