"""Files of every kind that strangers hand in, sound and damaged: each is read, or is one line of our own error."""

import re
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

import lutforge as lf
from lutforge.cli.console import quiet_codecs
from lutforge.errors import LutForgeError
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.raw import read_raw
from lutforge.kits.dcp import DngProfile, write_dcp
from lutforge.kits.icc import IccProfile, write_icc
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import FORMATS, Lut
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
from tests.cases.pictures import lut_of_nodes
from tests.cases.profiles import small_profile
from tests.cases.real_data import S40

LONGEST, SLOWEST = 500, 5.0
"""Characters of a message, and seconds of processor time that a file may take."""


def _shot(path: Path) -> None:
    read_raw(path, half_size=True)
    read_shot(path)


def _config(path: Path) -> None:
    check_config(load_config(path))


def _lut(path: Path) -> None:
    assert all(line.isprintable() for line in report_lines(check_lut(path)))


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


LUTS = (".1d.cube", ".resolve.cube", *(f".lut{suffix}" for suffix in FORMATS if suffix != ".tiff"))
"""Kinds of LUT files, one for each format."""
READERS: Mapping[str, Callable[[Path], object]] = {
    ".dng": _shot, ".jpg": inspect, ".ocio": _config, ".ocioz": _config, ".npz": _rendered, ".csv": read_samples,
    ".table.npz": read_samples, ".dcp": inspect, ".icc": inspect, ".exr": _graded, ".tif": _graded, ".png": _graded,
    ".graded.jpg": _graded, **dict.fromkeys(LUTS, _lut),
}  # fmt: skip
"""What reads a kind of file, which the end of its name tells."""


def whole_files(folder: Path) -> dict[str, bytes]:
    """A sound file of each kind."""
    profile = small_profile()
    profile.save(folder / "a.npz")
    settings = CameraSettings(exposure_s=nikon_d5100().nominal_exposure_s, preview_scale=1.0)
    shot = photograph(nikon_d5100(), SCENES["still-life"](232, 344, 1), settings, folder, "a")
    assert shot.jpeg is not None
    shot.jpeg.rename(folder / "a.jpg")
    (folder / "a.graded.jpg").write_bytes((folder / "a.jpg").read_bytes())
    write_config([profile], folder / "config", inverse_size=9)
    (folder / "config" / "config.ocio").rename(folder / "a.ocio")
    write_config([profile], folder / "a.ocioz", inverse_size=9)
    table = np.tile([0.0, 1.0, 1.0], (2, 6, 4, 1))
    write_dcp(DngProfile("a", "C", np.eye(3), np.eye(3), np.array([[0.0, 0.0], [1.0, 1.0]]), table), folder / "a.dcp")
    curve, cube = Curve(np.array([[0.0] * 3, [1.0] * 3])), Cube(np.full((2, 2, 2, 3), 0.5))
    write_icc(IccProfile("a", curve, cube), folder / "a.icc")
    rows = "camera,style,white_balance,shot,patch,exposure_s,raw_r,raw_g,raw_b,srgb_r,srgb_g,srgb_b\n"
    rows += "".join(f"C,s,w,{n % 3},{n},0.01,0.{n},0.2,0.3,0.4,0.{n},0.6\n" for n in range(10, 60))
    (folder / "a.csv").write_text(rows)
    (folder / "a.table.npz").write_bytes(S40.read_bytes())
    for suffix in (".exr", ".tif", ".png"):
        picture = oiio.ImageBuf(np.random.default_rng(2).random((24, 32, 3), dtype=np.float32))
        picture.specmod().attribute("Artist", "somebody")
        picture.write(str(folder / f"a{suffix}"), "half" if suffix == ".exr" else "uint8")
    lut = lut_of_nodes((np.array([0.0, 0.125, 1.0]),) * 3, grid(uniform_levels(3)) ** 0.5, size=9, comments=("a note",))
    for kind in (".resolve.cube", ".lut.clf", ".lut.ctf", ".lut.csp"):
        lut.write(folder / f"a{kind}")
    (folder / "a.1d.cube").write_text("LUT_1D_SIZE 3\n0 0 0\n.5 .5 .5\n1 1 1\n")
    lf.bake(lambda x: np.asarray(x, dtype=np.float64) ** 2, folder / "a.lut.spi1d", size=9)
    for kind in LUTS:
        if not (folder / f"a{kind}").exists():
            size = 17 if kind in (".lut.3dl", ".lut.vlt") else 4
            Lut((Cube(grid(uniform_levels(size)) ** 0.5),), title="title").write(folder / f"a{kind}")
    return {kind: (folder / f"a{kind}").read_bytes() for kind in READERS}


TOKENS = (
    *(b"-1", b"0", b"nan", b"inf", b"1e999", b"1e308", b"99999999999999999999", b"4294967296", b"129", b"1048576"),
    *(b"--1", b"", b"x" * 5000, b"\xc3\xa9", b"\xff\xfe", b"\xef\xbb\xbf", "٣".encode(), b"0x10", b"1_0", b"_"),
    *(b"\0\0\0\0", b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\x80\0\0\0", b"\x00", b"\r", b"\n", b"#", b'"'),
    *(b"{", b"}", b"<", b"&lol;", b"<!DOCTYPE x>", b"TITLE", b"3D\n", b"LUT_3D_SIZE 256\n", b"LUT_1D_SIZE 1048576\n"),
    *(b"DOMAIN_MAX 0 0 0\n", b"END METADATA\n", b"Length 1000000\n", b"halfDomain='true'", b"dim='256 256 256 3'"),
    b"<Array dim='2 2 2 3'>",
)


def damaged(data: bytes, rng: np.random.Generator) -> bytes:
    """The bytes with one to six damages, most of them near the beginning, where headers are."""
    text = bytearray(data)
    for _ in range(rng.integers(1, 7)):
        if not text:
            break
        at = int(rng.integers(len(text) if rng.random() < 0.5 else min(len(text), 4096)))
        span, token = int(rng.integers(1, 400)), TOKENS[rng.integers(len(TOKENS))]
        match rng.integers(8):
            case 0:
                text[at] ^= 1 << int(rng.integers(8))
            case 1:
                text[at : at + len(token)] = token
            case 2:
                text[at:at] = token
            case 3:
                del text[at:]
            case 4:
                del text[at : at + span]
            case 5:
                other = int(rng.integers(len(text)))
                text[at : at + span * int(rng.integers(2))] = text[other : other + span]
            case 6:
                text[at:at] = rng.bytes(int(rng.integers(1, 60)))
            case _:
                numbers = list(re.finditer(rb"-?\d+(\.\d+)?", bytes(text[at : at + 2000])))
                if numbers:
                    number = numbers[int(rng.integers(len(numbers)))]
                    text[at + number.start() : at + number.end()] = token
    return bytes(text)


def fault(path: Path, read: Callable[[Path], object]) -> str:
    """What is wrong with how a file is read; "" where it is read, or is one line of our own error."""
    began, problem = time.process_time(), ""
    try:
        with warnings.catch_warnings(), quiet_codecs():
            warnings.simplefilter("ignore")
            read(path)
    except LutForgeError as error:
        words = str(error).replace(str(path.parent), "")
        if len(words) > LONGEST or "\n" in words or not words.isprintable():
            problem = f"message of {len(words)} characters: {words[:200]!r}"
    except Exception as error:
        problem = f"{type(error).__name__}: {str(error)[:200]}"
    seconds = time.process_time() - began
    return problem or (f"{seconds:.1f} s" if seconds > SLOWEST else "")
