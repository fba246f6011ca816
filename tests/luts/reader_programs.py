"""The programs that read LUT files, each run on the same 16-bit colours; as a script, the table for the README.

    python -m tests.luts.reader_programs [profile.npz STYLE/WB STYLE/WB]

Without a profile: a fixed smooth transform. A line: program, version, format, mean and maximum ΔE00 to the model.
"""

import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import ColourFunction
from lutforge.interpolation import Interpolation
from lutforge.luts.sequence import Lut
from lutforge.pipeline.baking import bake

Array = NDArray[np.float64]
SIDE = 64
TIMEOUT = 120


def colours() -> NDArray[np.uint16]:
    """Random colours, the grey axis and the corners of the cube, as a 16-bit image (SIDE, SIDE, 3)."""
    grey = np.repeat(np.linspace(0, 1, 256)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    fill = np.random.default_rng(11).random((SIDE * SIDE - len(grey) - len(corners), 3))
    codes = np.rint(np.concatenate([grey, corners, fill]) * 65535).astype(np.uint16)
    return np.asarray(codes.reshape(SIDE, SIDE, 3), dtype=np.uint16)


def smooth_look(x: ArrayLike) -> Array:
    """A look with a toe, a shoulder and crossed channels; [0, 1]³ → [0, 1]³."""
    values = np.clip(np.asarray(x, dtype=np.float64), 0.0, 1.0)
    linear = values**2.2 @ np.array([[1.25, -0.15, -0.1], [-0.12, 1.2, -0.08], [-0.02, -0.2, 1.22]]).T
    mapped = np.clip(linear, 0.0, None)
    look: Array = np.clip(1.05 * mapped / (mapped + 0.18) * 1.12, 0.0, 1.0) ** (1 / 1.6)
    return look


def write_image(path: Path, codes: NDArray[np.uint16]) -> None:
    spec = oiio.ImageSpec(codes.shape[1], codes.shape[0], 3, oiio.UINT16)
    output = oiio.ImageOutput.create(str(path))
    assert output is not None, oiio.geterror()
    assert output.open(str(path), spec), output.geterror()
    assert output.write_image(np.ascontiguousarray(codes))
    output.close()


def read_image(path: Path) -> Array:
    source = oiio.ImageInput.open(str(path))
    assert source is not None, oiio.geterror()
    pixels = np.asarray(source.read_image(oiio.FLOAT), dtype=np.float64)
    source.close()
    return pixels[..., :3]


def run(command: list[str], folder: Path) -> str:
    """Run a program in a folder that is its home, too, and return what it prints."""
    environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "HOME": str(folder), "LC_ALL": "C.UTF-8"}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, errors="replace", timeout=TIMEOUT, env=environment
    )
    assert done.returncode == 0, f"{command[0]} failed: {(done.stderr or done.stdout)[-500:]}"
    return done.stdout + done.stderr


@dataclass(frozen=True)
class Program:
    """A reader: its command, its Debian package, the format that it is given, the interpolation that it uses."""

    name: str
    commands: tuple[str, ...]
    package: str
    suffix: str
    interpolation: Interpolation
    apply: Callable[[str, Path, Path], Path]
    version: tuple[str, ...] = ("--version",)
    reader: str | None = None

    @property
    def command(self) -> str | None:
        """Where the program is, or none."""
        path = f"{Path(sys.executable).parent}:/usr/bin:/bin"
        return next((found for found in (shutil.which(name, path=path) for name in self.commands) if found), None)

    def version_text(self, folder: Path) -> str:
        command = self.command
        assert command is not None
        done = subprocess.run([command, *self.version], cwd=folder, capture_output=True, text=True, timeout=TIMEOUT)
        found = re.search(r"\d+\.\d+[\w.\-]*", done.stdout + done.stderr)
        return found.group() if found else "?"


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
    load = ["-input_cube", str(lut)] if lut.suffix == ".cube" else [str(lut), "-div[-1]", "257"]
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
    Program("ffmpeg lut3d", ("ffmpeg",), "ffmpeg", ".cube", "tetrahedral", _ffmpeg, ("-version",), "ffmpeg"),
    Program("ffmpeg lut3d", ("ffmpeg",), "ffmpeg", ".csp", "tetrahedral", _ffmpeg, ("-version",), "ffmpeg"),
    Program("oiiotool", ("oiiotool",), "openimageio-tools", ".clf", "tetrahedral", _oiiotool),
    Program("oiiotool", ("oiiotool",), "openimageio-tools", ".cube", "tetrahedral", _oiiotool, reader="oiio"),
    Program("oiiotool", ("oiiotool",), "openimageio-tools", ".csp", "tetrahedral", _oiiotool, reader="oiio"),
    Program(
        "ImageMagick", ("convert-im6.q16", "magick"), "imagemagick", ".png", "trilinear", _imagemagick, ("-version",)
    ),
    Program("G'MIC", ("gmic",), "gmic", ".cube", "trilinear", _gmic, ("-h",), "gmic"),
    Program("G'MIC", ("gmic",), "gmic", ".png", "trilinear", _gmic, ("-h",), "gmic"),
    Program("darktable", ("darktable-cli",), "darktable", ".cube", "tetrahedral", _darktable, reader="darktable"),
    Program("RawTherapee", ("rawtherapee-cli",), "rawtherapee", ".tif", "trilinear", _rawtherapee, ("-v",)),
)


def rendered(program: Program, lut: Path, folder: Path) -> tuple[Array, Array]:
    """Colours in and out of a program, (n, 3) each in [0, 1]."""
    codes = colours()
    for name in ("in.png", "in.tif"):
        write_image(folder / name, codes)
    assert program.command is not None
    out = read_image(program.apply(program.command, folder, lut))
    assert out.shape == codes.shape, f"{program.name} made an image of {out.shape}"
    return codes.reshape(-1, 3) / 65535.0, out.reshape(-1, 3)


def baked(program: Program, transform: ColourFunction, folder: Path) -> Lut:
    """The LUT that is baked for a program, and its file in a folder."""
    path = folder / f"lut{program.suffix}"
    return bake(transform, path, program=program.reader, interpolation=program.interpolation)


def main() -> None:
    from lutforge.colour.srgb import delta_e_2000
    from lutforge.model.camera_profile import load_profile

    transform: ColourFunction = smooth_look
    if len(sys.argv) == 4:
        transform = load_profile(sys.argv[1]).refinish(sys.argv[2], sys.argv[3])
    print("| program | version | format | ΔE00 mean | ΔE00 max |\n|---|---|---|---|---|")
    for program in PROGRAMS:
        if program.command is None:
            print(f"| {program.name} | not installed ({program.package}) | {program.suffix} | | |")
            continue
        with TemporaryDirectory() as name:
            folder = Path(name)
            lut = baked(program, transform, folder)
            try:
                x, got = rendered(program, folder / f"lut{program.suffix}", folder)
            except (AssertionError, subprocess.TimeoutExpired) as failure:
                print(
                    f"| {program.name} | {program.version_text(folder)} | {program.suffix} | {str(failure)[:160]!r} | |"
                )
                continue
            error = delta_e_2000(got, transform(x))
            version = program.version_text(folder)
        print(f"| {program.name} | {version} | {lut.summary} | {error.mean():.3f} | {error.max():.2f} |", flush=True)


if __name__ == "__main__":
    main()
