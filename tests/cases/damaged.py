"""Files of every kind that strangers hand in, sound and damaged: each is read, or is one line of our own error."""

import io
import math
import re
import sys
import tempfile
import time
import warnings
import zipfile
import zlib
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pillow_heif
from PIL import Image

import lutforge as lf
from lutforge.cli.console import quiet_codecs
from lutforge.errors import LutForgeError
from lutforge.grading.grade import LutRecipe
from lutforge.grading.image import apply_image
from lutforge.images.packet_writer import add_packets
from lutforge.images.raw import read_raw
from lutforge.kits.dcp import DngProfile, write_dcp
from lutforge.kits.icc import IccProfile, write_icc
from lutforge.luts.check import check_lut, report_lines
from lutforge.luts.formats import FORMATS
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import Lut
from lutforge.model.camera_profile import load_profile
from lutforge.model.lattice import grid, uniform_levels
from lutforge.ocio.config import write_config
from lutforge.ocio.merging import open_base
from lutforge.pipeline.inspection import check, inspect
from lutforge.progress import silent
from lutforge.samples.table import read_samples
from lutforge.shots.read import read_shot
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from lutforge.studio.opening import open_paths
from lutforge.studio.workspace import Workspace
from lutforge.studio.workspace_file import save_workspace
from tests.cases.lut_texts import SOUND
from tests.cases.pictures import lut_of_nodes
from tests.cases.profiles import small_profile
from tests.cases.real_data import S40

LONGEST, SLOWEST = 500, 5.0
"""Characters of a message, and seconds of processor time that a file may take."""


def _shot(path: Path) -> None:
    read_raw(path, half_size=True)
    read_shot(path)


def _config(path: Path) -> None:
    check(path)
    with open_base(path) as base:
        assert base is not None


def _lut(path: Path) -> None:
    """As `check` and `apply` do."""
    assert all(line.isprintable() for line in report_lines(check_lut(path)))
    recipe = LutRecipe(path)
    recipe.check()
    recipe.grade(path).processor.applyRGB(np.full((4, 3), 0.5, dtype=np.float32))


def _inspected(path: Path) -> None:
    inspect(path)
    _graded(path)


def _graded(path: Path) -> None:
    """As `apply` does with a LUT."""
    lut = path.with_name("grade.cube")
    target = path.with_name("graded.png" if path.suffix == ".heic" else f"graded{path.suffix}")
    if not lut.exists():
        Lut((Cube(grid(uniform_levels(3)) ** 0.9),)).write(lut)
    recipe = LutRecipe(lut)
    apply_image(recipe.grade(path), path, target, workers=1)


def _rendered(path: Path) -> None:
    """A profile, and what it makes of colours."""
    profile = load_profile(path)
    first = next(iter(profile.styles)), next(iter(profile.white_balances))
    lf.bake(profile.render("/".join(first)), size=9, form="plain")


def _opened(path: Path) -> None:
    """As the studio does with a workspace."""
    open_paths((path,), silent)


TEXT_LUTS = {f".{name}": text for name, text in SOUND.items() if name not in ("a.cube", "a.vlt", "a.clf", "a.ctf")}
"""The small files of text that nobody bakes, by the end of their names."""
LUTS = (*TEXT_LUTS, ".1d.cube", ".resolve.cube", *(f".lut{suffix}" for suffix in FORMATS if suffix != ".tiff"))
"""Kinds of LUT files, one for each format."""
OTHER_PICTURES = (".bmp", ".dpx", ".hdr", ".jxl", ".sgi", ".tga")
"""Kinds of pictures that only `apply` reads."""
READERS: Mapping[str, Callable[[Path], object]] = {
    ".dng": _shot, ".jpg": inspect, ".ocio": _config, ".ocioz": _config, ".npz": _rendered, ".csv": read_samples,
    ".table.npz": read_samples, ".dcp": inspect, ".icc": inspect, ".exr": _inspected, ".tif": _inspected,
    ".png": _inspected, ".graded.jpg": _inspected, ".webp": _inspected, ".jp2": _inspected, ".heic": _inspected,
    **dict.fromkeys(OTHER_PICTURES, _graded), ".workspace": _opened,
    **dict.fromkeys(LUTS, _lut),
}  # fmt: skip
"""What reads a kind of file, which the end of its name tells."""


PACKET = (
    b'<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
    b'<rdf:Description xmlns:xmp="http://ns.adobe.com/xap/1.0/" xmp:Rating="4" GCamera:MotionPhoto="1" xmp:Label="'
    + b"a" * 70_000
    + b'"><Container:Directory><rdf:Seq/></Container:Directory></rdf:Description></rdf:RDF></x:xmpmeta>'
)
"""XMP that a JPEG holds in a segment and an extension, and that declares a film behind the picture."""


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
    for suffix in (".exr", ".tif", ".png", ".webp", ".jp2"):
        shape = (240, 320, 3) if suffix == ".jp2" else (24, 32, 3)  # OpenImageIO reads no smaller JPEG 2000
        picture = oiio.ImageBuf(np.random.default_rng(2).random(shape, dtype=np.float32))
        picture.specmod().attribute("Artist", "somebody")
        picture.write(str(folder / f"a{suffix}"), "half" if suffix == ".exr" else "uint8")
        if suffix != ".exr":
            format = {".tif": "tiff", ".jp2": "jpeg2000"}.get(suffix, suffix[1:])
            add_packets(folder / f"a{suffix}", format, picture.spec(), PACKET, b"\x1c\2Z\0\6Berlin")
    for suffix in OTHER_PICTURES:
        picture = oiio.ImageBuf(np.random.default_rng(2).random((24, 32, 3), dtype=np.float32))
        picture.write(str(folder / f"a{suffix}"), "float" if suffix == ".hdr" else "uint8")
    save_workspace(Workspace(read_samples(folder / "a.csv")), folder / "a.workspace")
    add_packets(folder / "a.graded.jpg", "jpeg", oiio.ImageSpec(8, 8, 3, "uint8"), PACKET, b"\x1c\2Z\0\6Berlin")
    heif = Image.fromarray(np.random.default_rng(3).integers(0, 256, (64, 64, 3), dtype=np.uint8))
    pillow_heif.from_pillow(heif).save(str(folder / "a.heic"), quality=50, xmp=PACKET)
    lut = lut_of_nodes((np.array([0.0, 0.125, 1.0]),) * 3, grid(uniform_levels(3)) ** 0.5, size=9, comments=("a note",))
    for kind in (".resolve.cube", ".lut.clf", ".lut.ctf", ".lut.csp"):
        lut.write(folder / f"a{kind}")
    for end, text in TEXT_LUTS.items():
        (folder / f"a{end}").write_text(text, encoding="utf-8")
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
    """The bytes with one to six damages; of zip files and PNGs half of the time inside, where no checksum tells."""
    if rng.random() < 0.5:
        if data.startswith(b"PK"):
            return _damaged_zip(data, rng)
        if data.startswith(b"\x89PNG"):
            return _damaged_png(data, rng)
    return _damaged_bytes(data, rng)


def _damaged_zip(data: bytes, rng: np.random.Generator) -> bytes:
    """An archive one of whose entries is damaged."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    name = [*entries][rng.integers(len(entries))] if rng.random() < 0.5 else next(iter(entries))
    entries[name] = _damaged_bytes(entries[name], rng)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for each, content in entries.items():
            archive.writestr(each, content)
    return packed.getvalue()


CHUNKS = (
    *(b"eXIf", b"iTXt", b"tEXt", b"zTXt", b"iCCP", b"cICP", b"gAMA", b"cHRM", b"sRGB", b"acTL", b"tRNS", b"pHYs"),
    *(b"sBIT", b"bKGD", b"hIST", b"tIME", b"mDCV", b"cLLI", b"PLTE", b"IDAT", b"IHDR"),
)


def _damaged_png(data: bytes, rng: np.random.Generator) -> bytes:
    """A PNG with a chunk damaged, or one more, under a right checksum."""
    chunks, at = [], 8
    while at + 8 <= len(data):
        length = int.from_bytes(data[at : at + 4], "big")
        chunks.append((data[at + 4 : at + 8], data[at + 8 : at + 8 + length]))
        at += 12 + length
    if rng.random() < 0.5:
        place = int(rng.integers(len(chunks)))
        chunks[place] = (chunks[place][0], _damaged_bytes(chunks[place][1], rng))
    else:
        payload = _damaged_bytes(TOKENS[rng.integers(len(TOKENS))] + rng.bytes(int(rng.integers(40))), rng)
        chunks.insert(int(rng.integers(1, len(chunks))), (CHUNKS[rng.integers(len(CHUNKS))], payload))
    parts = [
        len(body).to_bytes(4, "big") + name + body + zlib.crc32(name + body).to_bytes(4, "big") for name, body in chunks
    ]
    return data[:8] + b"".join(parts)


ATTRIBUTES = (
    *("Exif:PhotographicSensitivity", "Exif:ExposureTime", "Exif:FNumber", "Make", "Model", "Software", "Orientation"),
    *("ImageDescription", "Exif:WhiteBalance", "colorInteropID", "oiio:ColorSpace", "DateTime", "chromaticities"),
    *("Exif:ISOSpeedRatings", "Exif:FocalLength", "GPS:Latitude", "smpte:TimeCode", "ICCProfile", "whiteLuminance"),
)
VALUES: tuple[tuple[str, object], ...] = (
    *(
        ("float[3]", (1.0, 2.0, 3.0)),
        ("int[2]", (1, 2)),
        ("string", "\u00e9\n\x07"),
        ("string", ""),
        ("matrix", (0.5,) * 16),
    ),
    *(("int", -1), ("float", math.nan), ("float", math.inf), ("rational", (1, 0)), ("string[2]", ("a", "b"))),
    *(("int", 2**31 - 1), ("float", -1e30), ("uint8[4]", (1, 2, 3, 4)), ("string", "x" * 5000), ("timecode", (1, 2))),
)


def write_odd_picture(path: Path, rng: np.random.Generator) -> None:
    """An EXR or TIFF with attributes of types and values that nobody expects."""
    spec = oiio.ImageSpec(8, 8, 3, "half" if path.suffix == ".exr" else "uint8")
    for name in rng.choice(ATTRIBUTES, 4, replace=False):
        kind, value = VALUES[rng.integers(len(VALUES))]
        with suppress(TypeError, ValueError):
            spec.attribute(str(name), oiio.TypeDesc(kind), value)
    oiio.ImageBuf(spec).write(str(path))


def _damaged_bytes(data: bytes, rng: np.random.Generator) -> bytes:
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
    except BaseException as error:
        if isinstance(error, KeyboardInterrupt):
            raise
        problem = f"{type(error).__name__}: {str(error)[:200]}"
    seconds = time.process_time() - began
    return problem or (f"{seconds:.1f} s" if seconds > SLOWEST else "")


def search(count: int, seed: int, folder: Path) -> int:
    """Read this many damaged files over all kinds, print each fault with its file, and return how many there were."""
    (folder / "sound").mkdir(exist_ok=True)
    sound = whole_files(folder / "sound")
    rng, kinds, faults = np.random.default_rng(seed), [*READERS], 0
    kinds.remove(".dng")  # of which each takes a second
    for number in range(count):
        kind = kinds[number % len(kinds)]
        path = folder / f"a{kind}"
        if kind in (".exr", ".tif") and rng.random() < 0.5:
            write_odd_picture(path, rng)
        else:
            path.write_bytes(damaged(sound[kind], rng))
        if problem := fault(path, READERS[kind]):
            faults += 1
            kept = folder / f"fault{number}{kind}"
            kept.write_bytes(path.read_bytes())
            print(f"{kept}: {problem}", flush=True)
    print(f"{count} files, {faults} faults", flush=True)
    return faults


if __name__ == "__main__":  # python -m tests.cases.damaged 20000 [SEED]
    sys.exit(bool(search(int(sys.argv[1]), int((sys.argv[2:] or ["0"])[0]), Path(tempfile.mkdtemp()))))
