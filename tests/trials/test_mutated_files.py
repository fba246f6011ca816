"""Files of every kind that are read from strangers, damaged: each is read, or is one line of our own error.

As a script it reads many more, in processes of their own, so that a crash of a native library is told, too:

    python -m tests.trials.test_mutated_files COUNT [KIND…]
"""

import re
import struct
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

import lutforge as lf
from lutforge.apply.grade import LutRecipe
from lutforge.apply.image import apply_image
from lutforge.cli.console import quiet_codecs
from lutforge.errors import LutError, LutForgeError
from lutforge.images.raw import read_raw
from lutforge.inverse.linearization import InverseOptions
from lutforge.kits.dcp import DngProfile, read_dcp, write_dcp
from lutforge.luts.check import check_lut
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import Form, Lut
from lutforge.model.camera_profile import load_profile
from lutforge.model.lattice import grid, uniform_levels
from lutforge.ocio.check import check_config, load_config
from lutforge.ocio.config import write_config
from lutforge.pipeline.inspection import inspect
from lutforge.samples.table import read_samples
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES
from tests.cases.profiles import small_profile
from tests.cases.real_data import S40

LONGEST, SLOWEST = 500, 5.0
"""Characters of a message, and seconds of processor time that a file may take."""


def _shot(path: Path) -> None:
    read_raw(path, half_size=True)
    read_shot(path)


def _config(path: Path) -> None:
    check_config(load_config(path))


def _dctl(path: Path) -> None:
    """With a sound cube beside it."""
    Lut((Cube(grid(uniform_levels(9))),)).write(path.with_suffix(".cube"))
    check_lut(path)


def _graded(path: Path) -> None:
    """As `apply` does with a LUT."""
    lut, target = path.with_name("grade.cube"), path.with_name(f"graded{path.suffix}")
    if not lut.exists():
        Lut((Cube(grid(uniform_levels(3)) ** 0.9),)).write(lut)
    recipe = LutRecipe(lut)
    apply_image(recipe.grade(path), path, target, workers=1)


def _rendered(path: Path) -> None:
    """A profile, and what it makes of colours."""
    profile = load_profile(path)
    first = next(iter(profile.styles)), next(iter(profile.white_balances))
    lf.bake(profile.render("/".join(first)), size=9, form="plain")


READERS: Mapping[str, Callable[[Path], object]] = {
    ".dng": _shot, ".jpg": inspect, ".ocio": _config, ".ocioz": _config, ".npz": _rendered, ".csv": read_samples,
    ".table.npz": read_samples, ".cube": check_lut, ".clf": check_lut, ".csp": check_lut, ".3dl": check_lut,
    ".dctl": _dctl, ".vlt": check_lut, ".spi1d": check_lut, ".spi3d": check_lut,
    ".dcp": inspect, ".exr": _graded, ".tif": _graded, ".png": _graded, ".graded.jpg": _graded,
}  # fmt: skip


def whole_files(folder: Path) -> dict[str, bytes]:
    """A sound file of each kind, by suffix."""
    profile = small_profile()
    profile.save(folder / "a.npz")
    settings = CameraSettings(exposure_s=nikon_d5100().nominal_exposure_s, preview_scale=1.0)
    shot = photograph(nikon_d5100(), SCENES["still-life"](232, 344, 1), settings, folder, "a")
    assert shot.jpeg is not None
    shot.jpeg.rename(folder / "picture.jpg")
    write_config([profile], folder / "config", inverse=InverseOptions(size=9, rounds=1))
    write_config([profile], folder / "a.ocioz", inverse=InverseOptions(size=9, rounds=1))
    Lut((Curve(np.linspace(0, 1, 64)[:, None].repeat(3, 1) ** 0.5), Cube(grid(uniform_levels(5))))).write(
        folder / "a.csp"
    )
    forms: dict[str, Form] = {"a.dctl": "shaper", "a.spi1d": "shaper"}
    for name, form in forms.items():
        lf.bake(lambda x: np.asarray(x, dtype=np.float64) ** 2, size=9, form=form).write(folder / name)
    table = np.tile([0.0, 1.0, 1.0], (2, 6, 4, 1))
    write_dcp(DngProfile("a", "C", np.eye(3), np.eye(3), np.array([[0.0, 0.0], [1.0, 1.0]]), table), folder / "a.dcp")
    for name in ("a.cube", "a.clf", "a.3dl", "a.vlt"):
        lf.bake(lambda x: np.asarray(x, dtype=np.float64) ** 2, size=17, form="plain").write(folder / name)
    rows = "camera,style,white_balance,shot,patch,exposure_s,raw_r,raw_g,raw_b,srgb_r,srgb_g,srgb_b\n"
    rows += "".join(f"C,s,w,{n % 3},{n},0.01,0.{n},0.2,0.3,0.4,0.{n},0.6\n" for n in range(10, 60))
    found = {suffix: (folder / f"a{suffix}").read_bytes() for suffix in (".npz", ".dng", ".ocioz", ".csp")}
    found |= {suffix: (folder / f"a{suffix}").read_bytes() for suffix in (".cube", ".clf", ".3dl", ".dctl", ".vlt")}
    found |= {suffix: (folder / f"a{suffix}").read_bytes() for suffix in (".spi1d", ".spi3d", ".dcp")}
    found |= {".jpg": (folder / "picture.jpg").read_bytes(), ".ocio": (folder / "config" / "config.ocio").read_bytes()}
    for suffix in (".exr", ".tif", ".png"):
        picture = oiio.ImageBuf(np.random.default_rng(2).random((24, 32, 3), dtype=np.float32))
        picture.specmod().attribute("Artist", "somebody")
        picture.write(str(folder / f"a{suffix}"), "half" if suffix == ".exr" else "uint8")
        found[suffix] = (folder / f"a{suffix}").read_bytes()
    found[".graded.jpg"] = found[".jpg"]
    return found | {".csv": rows.encode(), ".table.npz": S40.read_bytes()}


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to four damages, most of them near the beginning, where headers are."""
    text = bytearray(data)
    for _ in range(rng.integers(1, 5)):
        if not text:
            break
        reach = len(text) if rng.random() < 0.5 else min(len(text), 4096)
        at = int(rng.integers(reach))
        kind = int(rng.integers(7))
        if kind == 0:
            text[at] ^= 1 << int(rng.integers(8))
        elif kind == 1:
            text[at : at + 4] = rng.choice([b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\x80\0\0\0"])
        elif kind == 2:
            del text[at:]
        elif kind == 3:
            del text[at : at + int(rng.integers(1, 400))]
        elif kind == 4:
            text[at:at] = text[at : at + int(rng.integers(1, 400))]
        elif kind == 5:
            text[at:at] = rng.bytes(int(rng.integers(1, 60)))
        else:
            numbers = list(re.finditer(rb"-?\d+(\.\d+)?", bytes(text[at : at + 2000])))
            if numbers:
                found = numbers[int(rng.integers(len(numbers)))]
                text[at + found.start() : at + found.end()] = rng.choice(
                    [b"-1", b"nan", b"1e999", b"99999999999999999999", b"0", b"", b"--1", b"\xc3\xa9", b"x" * 5000]
                )
    return bytes(text)


def fault(path: Path, read: Callable[[Path], object]) -> str:
    """What is wrong with how a file is read; "" where it is read, or is one line of our own error."""
    began, told = time.process_time(), ""
    try:
        with warnings.catch_warnings(), quiet_codecs():
            warnings.simplefilter("ignore")
            read(path)
    except LutForgeError as error:
        words = str(error).replace(str(path.parent), "")
        if len(words) > LONGEST or "\n" in words or not words.isprintable():
            told = f"message of {len(words)} characters: {words[:200]!r}"
    except Exception as error:
        told = f"{type(error).__name__}: {str(error)[:200]}"
    seconds = time.process_time() - began
    return told or (f"{seconds:.1f} s" if seconds > SLOWEST else "")


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    return whole_files(tmp_path_factory.mktemp("sound"))


@pytest.mark.parametrize("suffix", READERS)
def test_whole_files_are_read(sound: dict[str, bytes], suffix: str, tmp_path: Path) -> None:
    (tmp_path / f"a{suffix}").write_bytes(sound[suffix])
    if suffix != ".ocio":  # its LUTs are elsewhere
        READERS[suffix](tmp_path / f"a{suffix}")


@pytest.mark.slow
@pytest.mark.parametrize("suffix", READERS)
def test_damaged_files_are_one_line(sound: dict[str, bytes], suffix: str, tmp_path: Path) -> None:
    rng, path = np.random.default_rng(7), tmp_path / f"a{suffix}"
    found = {}
    for number in range(20 if suffix == ".dng" else 60):
        path.write_bytes(mutated(sound[suffix], rng))
        if told := fault(path, READERS[suffix]):
            found[number] = told
    assert not found


def test_a_camera_profile_that_names_a_huge_table_takes_no_memory(sound: dict[str, bytes], tmp_path: Path) -> None:
    sizes, path = struct.pack("<III", 6, 4, 2), tmp_path / "a.dcp"
    assert sound[".dcp"].count(sizes) == 1
    path.write_bytes(sound[".dcp"].replace(sizes, struct.pack("<III", 313_125, 9, 278)))
    with pytest.raises(LutError, match="camera profile"):
        read_dcp(path)
    assert not fault(path, inspect)


def main(count: int, kinds: list[str]) -> None:
    """Read `count` damaged files of each kind, and print what went wrong; files that did are kept."""
    kept = Path(tempfile.mkdtemp(prefix="mutated-"))
    with tempfile.TemporaryDirectory() as name:
        sound = whole_files(Path(name))
    for suffix in kinds or READERS:
        (kept / f"sound{suffix}").write_bytes(sound[suffix])
        faults, first = 0, 0
        while first < count:
            command = [sys.executable, "-m", __spec__.name, "--batch", str(kept), suffix, str(first), str(count)]
            run = subprocess.run(command, capture_output=True, text=True, check=False)
            lines = run.stdout.splitlines()
            faults += sum(line.startswith("fault") for line in lines)
            print("\n".join(line for line in lines if line.startswith("fault")), flush=True)
            last = max((int(line.split()[1]) for line in lines), default=first)
            if run.returncode != 0:
                faults += 1
                print(
                    f"fault {last} {suffix}: the process ended with {run.returncode}: {run.stderr[-200:]!r}", flush=True
                )
            first = last + 1 if run.returncode != 0 else count
        print(f"{suffix}: {count} files, {faults} faults", flush=True)
    print(f"kept in {kept}")


def batch(folder: Path, suffix: str, first: int, last: int) -> None:
    """Read the damaged files of these numbers, each told of before it is read."""
    data, path = (folder / f"sound{suffix}").read_bytes(), folder / f"at{suffix}"
    for number in range(first, last):
        path.write_bytes(mutated(data, np.random.default_rng([7, number])))
        print("at", number, flush=True)
        if told := fault(path, READERS[suffix]):
            path.replace(folder / f"{number}{suffix}")
            print("fault", number, f"{suffix}: {told}", flush=True)


if __name__ == "__main__":
    if sys.argv[1] == "--batch":
        batch(Path(sys.argv[2]), sys.argv[3], int(sys.argv[4]), int(sys.argv[5]))
    else:
        main(int(sys.argv[1]), sys.argv[2:])
