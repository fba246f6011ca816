"""Our files read by others: colour-science reads them as OpenColorIO does, and programs show what they hold."""

import json
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import colour
import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.colour.srgb import delta_e_2000
from lutforge.images.read import read_image
from lutforge.interpolation import INTERPOLATIONS, Interpolation
from lutforge.luts.lut_kind import LutKind
from lutforge.luts.lut_programs import PROGRAMS as LUT_PROGRAMS
from lutforge.luts.ocio_transforms import evaluate
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.reading import trusted_processor
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, uniform_levels
from lutforge.pipeline.baking import bake
from tests.cases.other_versions import python_with_clf_reader
from tests.cases.pictures import write_picture


def look(x: ArrayLike) -> Array:
    """A look with a toe, a shoulder and crossed channels; [0, ∞)³ → [0, 1]³."""
    linear = np.asarray(x, dtype=np.float64) ** 2.2
    mixed = linear @ np.array([[1.25, -0.15, -0.1], [-0.12, 1.2, -0.08], [-0.02, -0.2, 1.22]]).T
    mapped = np.clip(mixed, 0.0, None)
    return np.asarray(np.clip(1.05 * mapped / (mapped + 0.18) * 1.12, 0.0, 1.0) ** (1 / 1.6))


def second_reading(path: Path, x: Array, method: Interpolation) -> Array:
    interpolator = getattr(colour.algebra, f"table_interpolation_{method}")
    dialects = {"a.cube": "Iridas Cube", "a.resolve.cube": "Resolve Cube"}
    sequence = colour.read_LUT(str(path), method=dialects.get(path.name))
    y: Any = x
    for stage in sequence if isinstance(sequence, colour.LUTSequence) else [sequence]:
        y = stage.apply(y, interpolator=interpolator) if isinstance(stage, colour.LUT3D) else stage.apply(y)
    return np.asarray(y, dtype=np.float64)


@pytest.mark.filterwarnings("ignore")  # it warns of tables that it converts to its own domain
@pytest.mark.parametrize("method", INTERPOLATIONS)
@pytest.mark.parametrize("highest", [1.0, 8.0])
@pytest.mark.parametrize("name", ["a.cube", "a.resolve.cube", "a.csp", "a.spi1d", "a.spi3d"])
def test_two_readers_agree(tmp_path: Path, name: str, highest: float, method: Interpolation) -> None:
    if highest > 1 and name in ("a.cube", "a.spi3d"):
        return  # these have no input beyond 1
    path = tmp_path / name
    bake(look, path, size=17, interpolation=method, highest=highest)
    x = np.random.default_rng(0).random((2000, 3)) * highest
    first = evaluate(trusted_processor(path, method), x)
    # float32 in one of them; OpenColorIO lays a spline through the knots of a .csp.
    np.testing.assert_allclose(second_reading(path, x, method), first, atol=1e-5 if highest == 1 else 5e-4)


def colours() -> NDArray[np.float32]:
    """Random colours, the grey axis and the corners of the cube, in 16 bits, as an image (64, 64, 3)."""
    grey = np.repeat(np.linspace(0, 1, 256)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    fill = np.random.default_rng(11).random((64 * 64 - len(grey) - len(corners), 3))
    codes = np.rint(np.concatenate([grey, corners, fill]) * 65535)
    return np.asarray((codes / 65535).reshape(64, 64, 3), dtype=np.float32)


def run(command: list[str], folder: Path) -> None:
    """Run a program in a folder that is its home, too."""
    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "HOME": str(folder), "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=600, env=environment
    )
    assert done.returncode == 0, f"{command[0]} failed: {(done.stderr or done.stdout)[-500:]}"


READ_CLF = """
import colour_clf_io, json, sys
nodes = colour_clf_io.read_clf_from_file(sys.argv[1]).process_nodes
arrays = [list(map(float, node.array.values)) if hasattr(node, "array") else [] for node in nodes]
print(json.dumps([[type(node).__name__ for node in nodes], arrays]))
"""


@pytest.mark.parametrize("version", ["3", None])
def test_the_clf_reader_of_colour_science_reads_the_academys_namespace(tmp_path: Path, version: str | None) -> None:
    """And refuses SMPTE's, as the page on files says: where it reads both one day, the page may say so."""
    python = python_with_clf_reader()
    lut = bake(look, tmp_path / "a.clf", size=5, clf_version=version)
    run = subprocess.run([str(python), "-c", READ_CLF, str(tmp_path / "a.clf")], capture_output=True, text=True)
    if version is None:
        assert "SMPTE ST 2136-1" in run.stderr
        return
    assert run.returncode == 0, run.stderr
    kinds, arrays = json.loads(run.stdout)
    assert kinds == ["Range", "LUT1D", "LUT3D"]
    curve, cube = (np.array(values).reshape(-1, 3) for values in arrays[1:])
    assert lut.cube is not None
    np.testing.assert_allclose(cube, lut.cube.values.reshape(-1, 3), atol=1e-6)
    (front,) = [op for op in lut.ops if isinstance(op, Curve)]
    np.testing.assert_allclose(curve, front.outputs, atol=1e-6)


@dataclass(frozen=True)
class Program:
    """A reader: its names, the format that it is given, the interpolation that it uses, how it is run.

    most: the largest difference of a channel from the LUT in the file. The first do the same sums, the others their own
    rounding, interpolation, or a round trip through their working space; G'MIC works in 8 bits.
    """

    name: str
    commands: tuple[str, ...]
    suffix: str
    interpolation: Interpolation
    apply: Callable[[str, Path, Path], Path]
    most: float
    reader: str | None = None

    @property
    def command(self) -> str | None:
        """Where the program is, or none."""
        path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
        return next((found for found in (shutil.which(name, path=path) for name in self.commands) if found), None)


def _ffmpeg(command: str, folder: Path, lut: Path) -> Path:
    graph = f"format=rgb48le,lut3d=file={lut.name}:interp=tetrahedral,format=rgb48be"
    run([command, "-v", "error", "-y", "-i", "in.png", "-vf", graph, "-pix_fmt", "rgb48be", "out.png"], folder)
    return folder / "out.png"


def _oiiotool(command: str, folder: Path, lut: Path) -> Path:
    run([command, "in.png", "--ociofiletransform", str(lut), "-d", "uint16", "-o", "out.tif"], folder)
    return folder / "out.tif"


def _imagemagick(command: str, folder: Path, lut: Path) -> Path:
    run([command, "in.png", str(lut), "-hald-clut", "-depth", "16", "out.png"], folder)
    return folder / "out.png"


def _gmic(command: str, folder: Path, lut: Path) -> Path:
    enlarged = ["-input_cube", str(lut), "-resize[-1]", "256,256,256,3,3,0"]
    load = enlarged if lut.suffix == ".cube" else [str(lut), "-div[-1]", "257"]
    words = [command, "in.tif", "-div", "257", *load, "-map_clut[0]", "[1]", "-keep[0]", "-mul", "257", "-round"]
    run([*words, "-o", "out.tif,uint16"], folder)
    return folder / "out.tif"


def _rawtherapee(command: str, folder: Path, lut: Path) -> Path:
    (folder / "film.pp3").write_text(
        "[Version]\nAppVersion=5.9\nVersion=349\n\n[Film Simulation]\nEnabled=true\n"
        f"ClutFilename={lut}\nStrength=100\n\n[Color Management]\nInputProfile=(cameraICC)\nWorkingProfile=sRGB\n"
        "OutputProfile=RTv4_sRGB\nOutputProfileIntent=Relative\nOutputBPC=false\n\n[Exposure]\nAuto=false\n"
        "Clip=0\nHistogramMatching=false\nCurve=0;\n\n[Sharpening]\nEnabled=false\n"
    )
    run([command, "-q", "-Y", "-o", "out.tif", "-t", "-b16", "-p", "film.pp3", "-c", "in.tif"], folder)
    return folder / "out.tif"


def _darktable(command: str, folder: Path, lut: Path) -> Path:
    # dt_iop_lut3d_params_t, version 3: path (under the module's folder), colour space sRGB, tetrahedral, no keypoints.
    params = struct.pack("<512siii12288s128s", lut.name.encode(), 0, 0, 0, b"", b"")
    (folder / "in.xmp").write_text(
        '<?xml version="1.0" encoding="UTF-8"?>\n<x:xmpmeta xmlns:x="adobe:ns:meta/"><rdf:RDF '
        'xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#"><rdf:Description rdf:about="" '
        'xmlns:darktable="http://darktable.sf.net/" darktable:xmp_version="5" darktable:history_end="1" '
        'darktable:iop_order_version="2"><darktable:history><rdf:Seq><rdf:li darktable:num="0" '
        'darktable:operation="lut3d" darktable:enabled="1" darktable:modversion="3" '
        f'darktable:params="{params.hex()}" darktable:multi_name="" darktable:multi_priority="0"/>'
        "</rdf:Seq></darktable:history></rdf:Description></rdf:RDF></x:xmpmeta>\n"
    )
    settings = {
        "plugins/darkroom/lut3d/def_path": str(lut.parent),
        "plugins/imageio/format/png/bpp": "16",
        "opencl": "FALSE",
    }
    words = [command, "in.png", "in.xmp", "out.png", "--core", "--configdir", str(folder / "configuration")]
    words += ["--library", ":memory:"]
    for key, value in settings.items():
        words += ["--conf", f"{key}={value}"]
    run(words, folder)
    return folder / "out.png"


PROGRAMS = (
    Program("ffmpeg", ("ffmpeg",), ".cube", "tetrahedral", _ffmpeg, 1e-4, "ffmpeg"),
    Program("ffmpeg", ("ffmpeg",), ".csp", "tetrahedral", _ffmpeg, 2.5e-3, "ffmpeg"),
    Program("oiiotool", ("oiiotool",), ".clf", "tetrahedral", _oiiotool, 1e-4),
    Program("oiiotool", ("oiiotool",), ".cube", "tetrahedral", _oiiotool, 1e-4, "oiio"),
    Program("oiiotool", ("oiiotool",), ".csp", "tetrahedral", _oiiotool, 1e-4, "oiio"),
    Program("ImageMagick", ("convert-im6.q16", "magick"), ".png", "trilinear", _imagemagick, 0.02),
    Program("G'MIC", ("gmic",), ".cube", "trilinear", _gmic, 0.02, "gmic"),
    Program("G'MIC", ("gmic",), ".png", "trilinear", _gmic, 0.06, "gmic"),
    Program("darktable", ("darktable-cli",), ".cube", "tetrahedral", _darktable, 0.02, "darktable"),
    Program("RawTherapee", ("rawtherapee-cli",), ".tif", "trilinear", _rawtherapee, 0.02),
)


@pytest.mark.slow
@pytest.mark.parametrize("program", PROGRAMS, ids=lambda program: f"{program.name}{program.suffix}")
def test_the_program_renders_what_the_file_holds(tmp_path: Path, program: Program) -> None:
    if program.command is None:
        pytest.skip(f"{program.commands[0]} is not installed")
    path, picture = tmp_path / f"lut{program.suffix}", colours()
    lut = bake(look, path, program=program.reader, interpolation=program.interpolation)
    for name in ("in.png", "in.tif"):
        write_picture(tmp_path / name, kind="uint16", pixels=picture)
    shown = read_image(program.apply(program.command, tmp_path, path)).pixels[..., :3].astype(np.float64)
    x = picture.astype(np.float64)
    assert np.abs(shown - np.clip(lut(x), 0.0, 1.0)).max() < program.most
    error = delta_e_2000(shown, look(x))
    assert error.mean() < 0.4
    assert error.max() < 2.0


def _melt(command: str, folder: Path, lut: Path) -> Path:
    # MLT may lose its last frame where the machine is busy: five alike are written, one over the other.
    words = [command, "in.png", "out=4", "-filter", "avfilter.lut3d", f"av.file={lut}", "av.interp=tetrahedral"]
    words += [
        "-consumer",
        "avformat:out.png",
        "real_time=0",
        "vcodec=png",
        "pix_fmt=rgb24",
        "mlt_image_format=rgb",
        "f=image2",
    ]
    words += ["width=64", "height=64", "progressive=1", "update=1", "frame_rate_num=25", "frame_rate_den=1"]
    run([*words, "sample_aspect_num=1", "sample_aspect_den=1"], folder)
    return folder / "out.png"


def _graphicsmagick(command: str, folder: Path, lut: Path) -> Path:
    subprocess.run([command, "convert", "in.png", "-hald-clut", str(lut), "out.png"], cwd=folder, capture_output=True)
    return folder / "out.png"


def _mpv(command: str, folder: Path, lut: Path) -> Path:
    graph = f"lavfi=[format=gbrp16le,lut3d=file={lut.name}:interp=tetrahedral,format=rgb48le]"
    words = [command, "--no-config", "--no-audio", "--vo=image", "--vo-image-format=png", "--frames=1", f"--vf={graph}"]
    run([*words, "in.png"], folder)
    return folder / "00000001.png"


def write_kinds(folder: Path) -> dict[LutKind, Path]:
    """A file of each kind that the table of programs names, as LutForge or others write it: of `look`, or a root."""
    nodes = {size: look(grid(uniform_levels(size))) for size in (17, 33, 64)}
    files = {
        LutKind.CUBE: Lut((Cube(nodes[33]),), title="a").write(folder / "plain.cube"),
        LutKind.FLAME_3DL: Lut((Cube(nodes[33]),)).write(folder / "large.3dl"),
        LutKind.FLAME_3DL_17_NODES_12_BITS: Lut((Cube(nodes[17]),)).write(folder / "small.3dl"),
        LutKind.CLF: Lut((Cube(nodes[33]),)).write(folder / "a.clf"),
        LutKind.OTHER: Lut((Cube(nodes[17]),)).write(folder / "a.vlt"),
        LutKind.HALD: Lut((Cube(nodes[64]),)).write(folder / "hald.png"),
    }
    text = files[LutKind.CUBE].read_text()
    curve = Curve(np.sqrt(np.linspace(0.0, 1.0, 1024))[:, None].repeat(3, axis=1))
    # Of 64 entries, since G'MIC makes a cube of a curve: one of 1,024 would take 13 GB.
    root = Curve(np.sqrt(np.linspace(0.0, 1.0, 64))[:, None].repeat(3, axis=1))
    files[LutKind.CUBE_OF_CURVE] = Lut((root,)).write(folder / "curve.cube")
    shaped = Lut((curve, Cube(look(grid(uniform_levels(33)) ** 2.0))))
    files[LutKind.CUBE_WITH_SHAPER] = shaped.write(folder / "a.resolve.cube")
    silent = "".join(row for row in files[LutKind.CUBE_WITH_SHAPER].read_text().splitlines(True) if "RANGE" not in row)
    domain = ("DOMAIN_MIN 0.0 0.0 0.0\nDOMAIN_MAX 1.0 1.0 1.0", "DOMAIN_MIN -1.0 -1.0 -1.0\nDOMAIN_MAX 1.0 1.0 1.0")
    wide = Lut((Cube(look(np.clip(2.0 * grid(uniform_levels(33)) - 1.0, 0.0, 1.0))),), title="a")
    range_only = text.replace(domain[0], "LUT_3D_INPUT_RANGE 0.0 1.0").replace('TITLE "a"\n', "")
    for kind, name, written in (
        (LutKind.CUBE_WITH_SHAPER_WITHOUT_RANGES, "silent.cube", silent),
        (LutKind.CUBE_WITH_RANGE, "range.cube", range_only),
        (LutKind.CUBE_WITH_DOMAIN, "domain.cube", wide.write(folder / "wide.cube").read_text().replace(*domain)),
    ):
        files[kind] = folder / name
        files[kind].write_text(written)
    return files


RUNS: dict[str, tuple[str, Callable[[str, Path, Path], Path]]] = {
    "ffmpeg": ("ffmpeg", _ffmpeg),
    "mpv": ("mpv", _mpv),
    "kdenlive": ("melt", _melt),
    "imagemagick": ("convert-im6.q16", _imagemagick),
    "graphicsmagick": ("gm", _graphicsmagick),
    "gmic": ("gmic", _gmic),
    "darktable": ("darktable-cli", _darktable),
}
"""How the programs of the table are run: the command, and what makes a picture with it."""


RUNS_BEFORE_REFUSED = 3
"""A program has refused a file where none of so many runs makes a picture: MLT loses all frames of a rare run."""


def picture_made(apply: Callable[[str, Path, Path], Path], command: str, folder: Path, lut: Path) -> Path | None:
    """The picture that a program makes with a file, or None where it refuses the file."""
    for _ in range(RUNS_BEFORE_REFUSED):
        with suppress(AssertionError):
            made = apply(command, folder, lut)
            if made.is_file():
                return made
    return None


@pytest.mark.slow
@pytest.mark.parametrize("name", RUNS)
def test_programs_do_with_other_files_what_the_table_says(tmp_path: Path, name: str) -> None:
    command, apply = RUNS[name]
    if shutil.which(command) is None:
        pytest.skip(f"{command} is not installed")
    picture = colours()
    for kind_of_file in ("png", "tif"):
        write_picture(tmp_path / f"in.{kind_of_file}", kind="uint16", pixels=picture)
    x = picture.astype(np.float64)
    for kind, path in write_kinds(tmp_path).items():
        says = LUT_PROGRAMS[name].does.get(kind, LUT_PROGRAMS[name].otherwise)
        for old in ("out.png", "out.tif", "00000001.png"):
            (tmp_path / old).unlink(missing_ok=True)
        shown = picture_made(apply, command, tmp_path, path)
        if shown is None:
            assert "refuses" in says, (kind, says)
            continue
        pixels = read_image(shown).pixels[..., :3].astype(np.float64)
        expected = np.sqrt(x) if kind is LutKind.CUBE_OF_CURVE else look(x)
        right, same = (255 * np.abs(pixels - other).mean() for other in (expected, x))
        assert ("as it is" in says) == (same < 1.0) or kind is LutKind.HALD, (kind, says, same)
        assert ("wrong colours" in says) == (right > 4.0 and same > 4.0), (kind, says, right)


@pytest.mark.parametrize(
    ("name", "command"), [("ffmpeg", ["ffmpeg", "-filters"]), ("mlt", ["melt", "-query", "filters"])]
)
def test_filters_that_the_table_names_are_there(name: str, command: list[str]) -> None:
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed")
    shown = subprocess.run(command, capture_output=True, text=True, timeout=60).stdout
    named = re.findall(r"its filter (\w+) reads it", " ".join(LUT_PROGRAMS[name].does.values()))
    assert "lut1d" in named
    for word in named:
        assert re.search(rf"\b{word}\b", shown), word
