"""LUT file formats: each says which sequences of operations a file can hold, and writes them.

Most are tables of numbers in text, with plain ASCII comments. Each writer takes a LUT whose form has been checked.
"""

import hashlib
import re
import unicodedata
from math import isqrt
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path
from lutforge.errors import LutError, one_line
from lutforge.luts.ops import Cube, Curve, Matrix, node_levels
from lutforge.luts.picture import read_picture
from lutforge.luts.sequence import FORMATS, FileFormat, Lut, group_of, read_input_and_output

DIGITS = 6
"""Decimals of a number in a cube: an error of 5e-7, a thirtieth of a step of 16 bits."""

SHAPER_DIGITS = 9
"""Decimals of a number in a curve, which a cube behind it magnifies by its steepness."""


CLF_NAMESPACE = "CLF namespace"
"""The key of a LUT's metadata that names the namespace of a .clf; without it that of SMPTE ST 2136-1 is written."""

AMPAS_CLF_3 = "urn:AMPAS:CLF:v3.0"
"""The namespace of version 3.0 of the Academy's specification (S-2014-006), which more readers take than SMPTE's."""

PHOTO_STYLE = "photo style"
"""The key of a LUT's metadata that names the picture style of a Lumix body on which it lies, such as "STD"."""


def write_text(path: Path, text: str, encoding: str = "ascii") -> None:
    """Write a text file atomically, with line feeds on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding=encoding, newline="\n")


def plain(text: str, limit: int = 200) -> str:
    """One line of printable ASCII without double quotes, at most `limit` characters."""
    decomposed = unicodedata.normalize("NFKD", " ".join(text.split()).replace("Δ", "d"))
    kept = "".join(c for c in decomposed if not unicodedata.combining(c))
    return kept.replace('"', "'").encode("ascii", "replace").decode()[:limit]


def comment_lines(title: str, comments: tuple[str, ...]) -> list[str]:
    """Title and comments as lines that begin with "# "; empty ones are left out."""
    return [f"# {plain(line)}" for line in (title, *comments) if plain(line)]


def rows(values: ArrayLike, digits: int = DIGITS) -> str:
    """Numbers (n, 3), a row per line, rounded to `digits` decimals, never "-0"; no reader has to know exponents."""
    numbers = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return (f"%.{digits}f %.{digits}f %.{digits}f\n" * len(numbers)) % tuple(numbers.ravel().tolist())


def cube_of_rows(table: Array, size: int) -> Array:
    """Rows whose red index advances first → (N, N, N, 3)."""
    return np.ascontiguousarray(table.reshape(size, size, size, 3).transpose(2, 1, 0, 3))


def rows_of_cube(values: Array) -> Array:
    """Node values (N, N, N, 3) as rows (n, 3) whose red index advances first."""
    return np.ascontiguousarray(values.transpose(2, 1, 0, 3)).reshape(-1, 3)


# --- .cube: a 3D table (Adobe Cube LUT Specification 1.0, Iridas), a 1D table, or a shaper in front of a 3D table ----
# The last is what DaVinci Resolve writes and OpenColorIO reads. Comments come before its header, and there is no TITLE
# and no DOMAIN line: OpenColorIO (FileFormatResolveCube) refuses the file otherwise. The input ranges, whose default is
# 0 to 1, are written out: a reader that knows the 3D form only, such as ffmpeg's lut3d, then refuses the file instead
# of rendering garbage.


def write_cube(lut: Lut, path: Path) -> None:
    """Write a cube as the plain 3D form, one with a shaper as Resolve's, a curve as the 1D form; red varies fastest."""
    curve, cube = lut.shaper_and_cube()
    table = rows(rows_of_cube(cube.values))
    if curve is None:
        header = [
            f'TITLE "{plain(lut.title) or "LutForge"}"',
            *_photo_style(lut),
            *comment_lines("", lut.comments),
            f"LUT_3D_SIZE {cube.size}",
            "DOMAIN_MIN 0.0 0.0 0.0",
            "DOMAIN_MAX 1.0 1.0 1.0",
        ]
    else:
        header = [
            *comment_lines(lut.title, lut.comments),
            f"LUT_1D_SIZE {len(curve.outputs)}",
            f"LUT_1D_INPUT_RANGE {curve.low!r} {curve.high!r}",
        ]
        if lut.cube is not None:
            header += [f"LUT_3D_SIZE {cube.size}", "LUT_3D_INPUT_RANGE 0.0 1.0"]
        table = rows(curve.outputs, SHAPER_DIGITS) + (table if lut.cube is not None else "")
    write_text(path, "\n".join(header) + "\n" + table)


def _photo_style(lut: Lut) -> list[str]:
    """The line that names the picture style that a LUT lies on in a Lumix body, where it is made for one.

    It has no blank behind "#", and stands in the second line; without it bodies take V-Log for the base.
    """
    style = lut.metadata.get(PHOTO_STYLE)
    return [] if style is None else [f"#LUMIXPHOTOSTYLE {style}"]


CUBE = FileFormat(".cube", (".cube",), ("plain", "shaper"), write_cube)


# --- .csp (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube --------------------------
# ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.


def write_csp(lut: Lut, path: Path) -> None:
    """Write a cube with a shaper, or none; red varies fastest.

    The prelut holds the knots of a curve, or some of its even steps, the nodes and their neighbours: with these
    OpenColorIO's spline stays within 1e-5 of straight lines.
    """
    curve, cube = lut.shaper_and_cube()
    notes = [line for line in (plain(text) for text in (lut.title, *lut.comments)) if line]
    lines = ["CSPLUTV100", "3D", "", "BEGIN METADATA", *notes, "END METADATA", ""]
    for channel in range(3):
        x = y = np.array([0.0, 1.0])
        if curve is not None and curve.inputs is not None:
            x, y = curve.inputs[:, channel], curve.outputs[:, channel]
        elif curve is not None:
            span, last = curve.high - curve.low, len(curve.outputs) - 1
            node = np.rint((node_levels(curve, cube)[channel] - curve.low) / span * last).astype(np.int64)
            even = np.linspace(0, last, min(16384, last + 1)).astype(np.int64)
            index = np.unique(np.clip(np.concatenate([even, node, node - 1, node + 1]), 0, last))
            x, y = curve.low + index / last * span, curve.outputs[index, channel]
        lines += [str(len(x)), " ".join(f"{v:.9f}" for v in x), " ".join(f"{v:.9f}" for v in y)]
    lines += ["", f"{cube.size} {cube.size} {cube.size}"]
    write_text(path, "\n".join(lines) + "\n" + rows(rows_of_cube(cube.values)))


CSP = FileFormat(".csp", (".csp",), ("shaper",), write_csp, size=33, knots=True)


# --- .spi1d and .spi3d (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs --------------

SPI_PAIR = (".spi1d", ".spi3d")
"""The suffixes of a shaper and a cube that belong together, in the order in which they are used."""


def write_spi(lut: Lut, path: Path) -> None:
    """Write both files of a LUT: the shaper, which is straight where there is none, and the cube."""
    shaper, cube = lut.shaper_and_cube()
    curve = shaper or Curve(np.repeat([[0.0], [1.0]], 3, axis=1))
    header = f"Version 1\nFrom {curve.low!r} {curve.high!r}\nLength {len(curve.outputs)}\nComponents 3\n{{\n"
    # Comments are behind the tables: the readers count the lines in front of them.
    comments = "".join(f"{line}\n" for line in comment_lines(lut.title, lut.comments))
    write_text(path.with_suffix(SPI_PAIR[0]), header + rows(curve.outputs, SHAPER_DIGITS) + "}\n" + comments)
    n = cube.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(cube.values.reshape(-1, 3), DIGITS) + 0.0], axis=1)
    body = (f"%d %d %d %.{DIGITS}f %.{DIGITS}f %.{DIGITS}f\n" * len(table)) % tuple(table.ravel().tolist())
    write_text(path.with_suffix(SPI_PAIR[1]), f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body + comments)


SPI = FileFormat(
    ".spi1d (shaper) and .spi3d (cube), used one after the other", SPI_PAIR, ("shaper",), write_spi, size=33
)


# --- .3dl (Autodesk Flame and Lustre, Kodak) and .vlt (Panasonic VariCam and Lumix bodies): cubes of 12-bit integers --
# Readers of .3dl tell the depth from the largest number, and some take 12 bits for granted: 12 bits it is. A .vlt has
# 17³ nodes, red fastest, behind three header lines and a blank one, as LUTCalc describes the files that Panasonic's
# cameras write (https://github.com/cameramanben/LUTCalc, js/lut-vlt.js); our comments are in front of the third.

TOP, VLT_SIZE = 4095, 17
_VLT_HEADER = ("# panasonic vlt file version 1.0", '# source vlt file ""', f"LUT_3D_SIZE {VLT_SIZE}")


def _whole_rows(table: Array) -> str:
    """Rows (n, 3) clamped to [0, 1], as 12-bit integers."""
    codes = np.rint(np.clip(table, 0.0, 1.0) * TOP).astype(int)
    return ("%d %d %d\n" * len(codes)) % tuple(codes.ravel().tolist())


def write_3dl(lut: Lut, path: Path) -> None:
    """Write a cube in 12 bits, blue fastest, outputs clamped to [0, 1]."""
    _, cube = lut.shaper_and_cube()
    mesh = np.rint(np.linspace(0, 1023, lut.size)).astype(int)
    header = [*comment_lines(lut.title, lut.comments), " ".join(map(str, mesh.tolist()))]
    write_text(path, "\n".join(header) + "\n" + _whole_rows(cube.values.reshape(-1, 3)))


def write_vlt(lut: Lut, path: Path) -> None:
    """Write a cube in 12 bits, outputs clamped to [0, 1].

    Some readers know no comments but Panasonic's two: others are written only where they say what the LUT takes.
    """
    _, cube = lut.shaper_and_cube()
    described = read_input_and_output(lut.comments) is not None
    comments = [*_photo_style(lut), *(comment_lines(lut.title, lut.comments) if described else [])]
    header = [*_VLT_HEADER[:-1], *comments, _VLT_HEADER[-1]]
    write_text(path, "\n".join(header) + "\n\n" + _whole_rows(rows_of_cube(cube.values)))


def read_vlt(path: Path) -> Lut:
    """Read a .vlt. Raises LutError."""
    lines = [line for line in path.read_text("utf-8", "replace").splitlines() if line.strip()]
    comments = tuple(line.lstrip("# ")[:200] for line in lines if line.startswith("#"))
    numbers = [line for line in lines if not line.startswith("#")]
    if numbers[:1] != [_VLT_HEADER[-1]] or len(numbers) != 1 + VLT_SIZE**3:
        raise LutError(f"{path}: a .vlt has the line {_VLT_HEADER[-1]}, and {VLT_SIZE**3} rows behind it")
    try:
        table = np.loadtxt(numbers[1:], dtype=np.int64, ndmin=2, comments=None)
    except ValueError as error:
        raise LutError(f"{path}: its table is not of whole numbers ({one_line(str(error), 100)})") from error
    if table.shape[1] != 3 or table.min() < 0 or table.max() > TOP:
        raise LutError(f"{path}: its table is not of three whole numbers a row from 0 to {TOP}")
    return Lut((Cube(cube_of_rows(table / TOP, VLT_SIZE)),), "", comments, {"bits": "12"})


THREEDL = FileFormat(".3dl", (".3dl",), ("plain",), write_3dl, (17, 33, 65), 33, 12)
VLT = FileFormat(".vlt", (".vlt",), ("plain",), write_vlt, (VLT_SIZE,), VLT_SIZE, 12, read=read_vlt)


# --- .clf and .ctf: the Academy/ASC Common LUT Format (SMPTE ST 2136-1) and Autodesk's superset of it -----------------
# OpenColorIO reads and writes them: it is the reference implementation of both.


PROCESS_LISTS = {".clf": "Academy/ASC Common LUT Format", ".ctf": "Color Transform Format"}


def write_clf(lut: Lut, path: Path) -> None:
    """Write any LUT; the suffix says whether CLF or CTF. Raises LutError."""
    write_text(path, clf_text(lut, path.suffix.lower()), "utf-8")


def clf_text(lut: Lut, suffix: str = ".clf") -> str:
    """The text of a process list. Raises LutError where OpenColorIO cannot write it."""
    group = group_of(lut.ops)
    metadata = group.getFormatMetadata()
    metadata.setID(_clf_identifier(lut))
    if lut.title:
        metadata.setName(one_line(lut.title))
    for comment in lut.comments:
        if comment.strip():
            metadata.addChildElement("Description", one_line(comment, 500))
    ends = read_input_and_output(lut.comments)
    if ends is not None:
        metadata.addChildElement("InputDescriptor", one_line(ends.input))
        metadata.addChildElement("OutputDescriptor", one_line(ends.output))
    try:
        text = str(group.write(PROCESS_LISTS[suffix], OCIO.Config.CreateRaw()))
    except OCIO.Exception as error:
        raise LutError(f"LUT: OpenColorIO cannot write it as {suffix}: {error}") from error
    if suffix != ".clf" or CLF_NAMESPACE not in lut.metadata:
        return text
    head = f'compCLFversion="3.0" xmlns="{lut.metadata[CLF_NAMESPACE]}"'
    return re.sub(r'compCLFversion="[^"]*" xmlns="[^"]*"', head, text, count=1)


def _clf_identifier(lut: Lut) -> str:
    """An id that depends on the content alone, so that the same LUT is the same file."""
    digest = hashlib.sha256()
    for op in lut.ops:
        digest.update(str(op).encode())
        arrays: tuple[Array, ...] = ()  # a range is its text
        match op:
            case Matrix():
                arrays = op.matrix, op.offset
            case Curve():
                arrays = (op.outputs,)
            case Cube():
                arrays = (op.values,)
        for array in arrays:
            digest.update(np.ascontiguousarray(array, dtype=np.float64).tobytes())
    h = digest.hexdigest()
    return f"urn:uuid:{h[:8]}-{h[8:12]}-8{h[13:16]}-8{h[17:20]}-{h[20:32]}"


CLF = FileFormat("CLF", tuple(PROCESS_LISTS), ("full",), write_clf, size=33)


# --- HaldCLUT: a uniform cube of L² nodes per axis as an image of L³ × L³ pixels, red fastest (Eskil Steenberg's Hald)
# `picture.py` reads it.


HALD_SIZES = tuple(level * level for level in range(2, 12))
"""Nodes per axis that a Hald image can have."""


def write_hald(lut: Lut, path: Path) -> None:
    """Write a cube in 16 bits, outputs clamped to [0, 1]. Raises LutError, and ImageError where the disk is full."""
    import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

    from lutforge.images.read import Region
    from lutforge.images.write import image_writer

    _, cube = lut.shaper_and_cube()
    side = isqrt(lut.size) ** 3
    codes = np.rint(np.clip(rows_of_cube(cube.values), 0.0, 1.0) * 65535).astype(np.uint16).reshape(side, side, 3)
    spec = oiio.ImageSpec(side, side, 3, oiio.UINT16)
    spec["ImageDescription"] = "; ".join(plain(text) for text in (lut.title, *lut.comments) if plain(text))
    with image_writer(path, spec) as output:
        output.write(Region(0, 0, side, side), codes)


HALD = FileFormat(
    "a Hald image", (".png", ".tif", ".tiff"), ("plain",), write_hald, HALD_SIZES, 64, 16, read=read_picture
)

for _known in (CLF, CSP, CUBE, HALD, SPI, THREEDL, VLT):
    FORMATS.update(dict.fromkeys(_known.suffixes, _known))
