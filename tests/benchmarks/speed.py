"""How long people wait, with the limit beside each figure: medians of alternating runs of whole commands.

    python -m tests.benchmarks.speed [WORDS…]    only the lines that hold one of the words

What is compared with another program runs in turn with it, so that whatever else the machine does meets both. The
photographs of `LUTFORGE_TEST_DATA` make the lines that need them; all else is made here. Where a part fails, the others
go on. The whole table takes about a quarter of an hour on two idle cores.
"""

import math
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import psutil
from PIL import Image as Pillow

from lutforge.arrays import Pixels
from lutforge.calibration.calibrate import calibrate
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile_file import save_profile
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples, write_samples
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES
from tests.benchmarks.bare_scripts import BARE_FLOAT, BARE_JPEG, BARE_RAW
from tests.cases.pictures import write_cube
from tests.cases.real_data import D40


@dataclass(frozen=True)
class Line:
    """A figure of the table: what, the value and its limit, at least or at most.

    processor: seconds of all cores, which other work on the machine changes less; NaN where it is not told.
    """

    what: str
    value: float
    limit: float
    unit: str = "s"
    at_least: bool = False
    processor: float = math.nan

    @property
    def held(self) -> bool:
        return self.value >= self.limit if self.at_least else self.value <= self.limit

    def __str__(self) -> str:
        limit = f"{'≥' if self.at_least else '≤'} {self.limit:g}"
        processor = "" if math.isnan(self.processor) else f"   processor {self.processor:.2f} s"
        share, mark = self.value / self.limit, "met" if self.held else "missed"
        return f"{self.what:<62}{self.value:8.2f} {self.unit:<3}{limit:>7}{share:8.2f}  {mark:<6}{processor}"


@dataclass(frozen=True)
class Ran:
    """A run of a command: its time, that of all processors, and the most memory that it held at once."""

    seconds: float
    megabytes: float
    processor: float


def run(*words: object, **environment: str) -> Ran:
    """Run a command with the package of this folder. Raises RuntimeError where it fails."""
    env = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment}
    env.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    before, began, most = os.times(), time.perf_counter(), 0.0
    with tempfile.TemporaryFile() as told:
        command = psutil.Popen(list(map(str, words)), env=env, stdout=subprocess.DEVNULL, stderr=told)
        waiting = threading.Thread(target=command.wait)
        waiting.start()
        while waiting.is_alive():
            waiting.join(0.02)
            with suppress(psutil.Error):
                most = max(most, command.memory_info().rss / 2**20)
        seconds, after = time.perf_counter() - began, os.times()
        told.seek(0)
        if command.returncode:
            last = told.read().decode("utf-8", "replace").strip().splitlines()[-1:]
            raise RuntimeError(f"it ended with status {command.returncode}: {' '.join(last)[:200]}")
    processor = after.children_user + after.children_system - before.children_user - before.children_system
    return Ran(seconds, most, processor)


def lutforge(*words: object, **environment: str) -> Ran:
    return run(sys.executable, "-m", "lutforge", *words, **environment)


def alternating(*sides: Callable[[], Ran], rounds: int = 3) -> list[list[Ran]]:
    """The runs of each side, one after the other in each round; a round before them fills caches."""
    runs = [[side() for side in sides] for _ in range(rounds + 1)][1:]
    return [list(side) for side in zip(*runs, strict=True)]


def timed(what: str, limit: float, run_once: Callable[[], Ran]) -> Line:
    """The time of a command, whose limit is of an idle machine."""
    (runs,) = alternating(run_once)
    seconds, processor = median(ran.seconds for ran in runs), median(ran.processor for ran in runs)
    return Line(what, seconds, limit, processor=processor)


def scene(height: int, width: int) -> Pixels:
    """Shades, edges and the noise of a sensor."""
    rng = np.random.default_rng(1)
    y, x = np.mgrid[0:height, 0:width].astype(np.float32) / width
    waves = [0.5 + 0.3 * np.sin(9 * x + c) * np.cos(7 * y - c) for c in range(3)]
    edges = [0.1 * (np.sin(60 * x * (c + 1)) > 0) for c in range(3)]
    noisy = np.stack(waves, -1) + np.stack(edges, -1) + rng.normal(0, 0.01, (height, width, 3))
    return np.asarray(np.clip(noisy, 0, 1), dtype=np.float32)


def jpegs(folder: Path, count: int, height: int, width: int) -> list[Path]:
    folder.mkdir()
    codes = np.rint(255 * scene(height, width)).astype(np.uint8)
    paths = [folder / f"{number:04d}.jpg" for number in range(count)]
    for number, path in enumerate(paths):
        Pillow.fromarray(np.roll(codes, 97 * number, axis=1)).save(path, quality=93, subsampling=1)
    return paths


def beside_a_bare_script(what: str, code: str, lut: Path, files: list[Path], share: float) -> Iterator[Line]:
    place = files[0].parent.parent
    ours, bare = alternating(
        lambda: lutforge("apply", lut, files[0].parent, "-o", place / "ours"),
        lambda: run(sys.executable, "-c", code, lut, place / "bare", *files),
    )
    ratio = median(b.seconds / a.seconds for a, b in zip(ours, bare, strict=True))
    yield Line(f"{what}: speed, of a bare script's", ratio, share, "", at_least=True)
    yield Line(f"{what}: memory", median(ran.megabytes for ran in ours), 400, "MB")


def jpeg_lines(folder: Path, lut: Path) -> Iterator[Line]:
    yield from beside_a_bare_script("12 JPEG of 24 Mpixel", BARE_JPEG, lut, jpegs(folder / "l", 12, 4000, 6000), 0.85)
    small = jpegs(folder / "s", 200, 1154, 1732)
    yield from beside_a_bare_script("200 JPEG of 2 Mpixel", BARE_JPEG, lut, small, 0.85)


def float_lines(folder: Path, lut: Path) -> Iterator[Line]:
    for suffix, kind, compression in ((".tif", "uint16", "none"), (".exr", "half", "zip")):
        files = [folder / suffix[1:] / f"{number}{suffix}" for number in range(6)]
        files[0].parent.mkdir()
        spec = oiio.ImageSpec(4000, 3000, 3, kind)
        spec.attribute("compression", compression)
        target = oiio.ImageOutput.create(str(files[0]))
        assert target is not None
        assert target.open(str(files[0]), spec)
        assert target.write_image(scene(3000, 4000))
        assert target.close()
        for path in files[1:]:
            path.hardlink_to(files[0])
        yield next(beside_a_bare_script(f"6 {suffix} of 12 Mpixel", BARE_FLOAT, lut, files, 0.9))


def start_lines(folder: Path, lut: Path, profile: Path) -> Iterator[Line]:
    (picture,) = jpegs(folder / "one", 1, 600, 800)
    yield timed("start: lutforge --help", 0.25, lambda: lutforge("--help"))
    yield timed("start: inspect a profile", 0.25, lambda: lutforge("inspect", profile))
    one = "start: apply a LUT to one small JPEG"
    yield timed(one, 0.35, lambda: lutforge("apply", lut, picture, "-o", folder / "out"))


def raw_lines(folder: Path, count: int = 60) -> Iterator[Line]:
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
        lambda: run(sys.executable, "-c", BARE_RAW, *files),
        rounds=2,
    )
    ratio = median(a.seconds / b.seconds for a, b in zip(ours, bare, strict=True))
    yield Line(f"sample {count} RAW of 24 Mpixel: time, of their decoding's", ratio, 1.3, "")


def fit_lines(folder: Path, table: Path, profile: Path) -> Iterator[Line]:
    data = os.environ.get("LUTFORGE_TEST_DATA")
    if data is not None:
        shots = sorted((Path(data) / "canon_powershot_s40").glob("*.CRW"))
        yield timed("calibrate: five RAW files", 4.0, lambda: lutforge("calibrate", *shots, "-o", folder / "s40.npz"))
    many = "calibrate: 5,000 samples, with held-out errors"
    yield timed(many, 2.0, lambda: lutforge("calibrate", table, "-o", folder / "c.npz"))
    yield timed("config of one style", 4.0, lambda: lutforge("config", profile, "-o", folder / "ocio", "--replace"))
    yield config_of_many(folder, load_profile(profile))


def config_of_many(folder: Path, profile: CameraProfile, cameras: int = 2) -> Line:
    """A config of cameras with four styles each, beside two bakes a camera."""
    (style,) = profile.styles.values()
    four = {f"style {number}": style for number in range(4)}
    paths = [folder / f"camera_{number}.npz" for number in range(cameras)]
    for path in paths:
        save_profile(replace(profile, camera=path.stem, styles=four), path)
    wanted = ("render", "--to", "style 0/daylight", "-o", folder / "baked.cube")
    whole, one = alternating(
        lambda: lutforge("config", *paths, "-o", folder / "ocio_of_many", "--replace"),
        lambda: lutforge("bake", paths[0], *wanted),
    )
    ratio = median(a.seconds / b.seconds for a, b in zip(whole, one, strict=True))
    processor = median(ran.processor for ran in whole)
    return Line(
        f"config of {cameras} cameras with 4 styles: bakes' time", ratio, 2.0 * cameras, "", processor=processor
    )


def demo_lines(folder: Path) -> Iterator[Line]:
    cache = {"XDG_CACHE_HOME": str(folder / "cache"), "NUMBA_CACHE_DIR": ""}
    first = lutforge("demo", "-o", folder / "demo", **cache)
    again = lutforge("demo", "-o", folder / "demo", **cache)
    yield Line("demo", again.seconds, 45.0, processor=again.processor)
    longer, more = first.seconds - again.seconds, first.processor - again.processor
    yield Line("demo: the first run, with no kernel compiled, longer by", longer, 15.0, processor=more)


def cluster_lines(folder: Path, lut: Path) -> Iterator[Line]:
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
    ratio = median(a.seconds / b.seconds for a, b in zip(alone, both, strict=True))
    yield Line("Dask: 240 JPEG of 6 Mpixel, two workers of one's speed", ratio, 1.8, "", at_least=True)


def samples_of_the_d40(count: int) -> SampleSet:
    """The published pairs of the Nikon D40, again with a little noise, in ten shots."""
    with np.load(D40) as data:
        balanced, jpeg, multipliers = data["balanced"], data["encoded"], data["multipliers"][0]
    rows = np.random.default_rng(0).integers(0, len(jpeg), count)
    raw = balanced[rows] / multipliers + np.random.default_rng(1).normal(0, 0.001, (count, 3))
    names = np.array([f"shot {number % 10}" for number in range(count)])
    camera, style, balance = (np.full(count, word) for word in ("Nikon D40", "standard", "daylight"))
    wb = np.tile(multipliers / multipliers[1], (count, 1))
    return SampleSet(camera, style, balance, names, names, np.ones(count), np.clip(raw, 0, 1), jpeg[rows], wb, camera)


def parts(folder: Path) -> dict[str, Callable[[], Iterator[Line]]]:
    """The parts of the table, by the words that ask for them."""
    lut, table, profile = write_cube(folder / "look.cube"), folder / "samples.csv", folder / "camera.npz"
    write_samples(table, samples_of_the_d40(5000))
    save_profile(calibrate(read_samples(table)).profile, profile)
    return {
        "start": lambda: start_lines(folder, lut, profile),
        "calibrate config": lambda: fit_lines(folder, table, profile),
        "jpeg": lambda: jpeg_lines(folder, lut),
        "tif exr": lambda: float_lines(folder, lut),
        "raw": lambda: raw_lines(folder),
        "dask": lambda: cluster_lines(folder, lut),
        "demo": lambda: demo_lines(folder),
    }


def main(wanted: list[str]) -> int:
    """Print the lines as they are measured; where a part fails, why, and go on. Returns how many parts failed."""
    began, met, count, failed = time.perf_counter(), 0, 0, 0
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}\n{'':<62}{'':>12}{'limit':>7}{'ratio':>8}")
    with tempfile.TemporaryDirectory() as scratch:
        for name, part in parts(Path(scratch)).items():
            if wanted and not any(word.lower() in name for word in wanted):
                continue
            try:
                for line in part():
                    print(line, flush=True)
                    met, count = met + line.held, count + 1
            except Exception as error:  # whatever it is: the other parts are measured
                print(f"{name}: not measured, {type(error).__name__}: {error}", flush=True)
                failed += 1
    minutes = (time.perf_counter() - began) / 60
    print(f"{met} of {count} limits met, {failed} parts failed; {minutes:.0f} min, load {os.getloadavg()[0]:.1f}")
    return failed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
