"""`.spi1d` and `.spi3d` (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import MOST_ENTRIES, MOST_NODES, Lines, rows, write_text
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.sequence import FileFormat, Lut, register

PAIR = (".spi1d", ".spi3d")
"""The suffixes of a shaper and a cube that belong together, in the order in which they are used."""


def write(lut: Lut, path: Path) -> None:
    """Write both files of a LUT: the shaper, which is straight where there is none, and the cube. Raises LutError."""
    shaper, cube = lut.shaper_and_cube()
    curve = shaper or Curve(np.repeat([[0.0], [1.0]], 3, axis=1))
    header = f"Version 1\nFrom {curve.low!r} {curve.high!r}\nLength {len(curve.outputs)}\nComponents 3\n{{\n"
    write_text(path.with_suffix(PAIR[0]), header + rows(curve.outputs) + "}\n")
    n = cube.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(cube.values.reshape(-1, 3), 10) + 0.0], axis=1)
    body = ("%d %d %d %.10f %.10f %.10f\n" * len(table)) % tuple(table.ravel().tolist())
    write_text(path.with_suffix(PAIR[1]), f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body)


def read_spi1d(path: Path, data: bytes) -> Lut:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    found: dict[str, int] = {}
    domain, index = (0.0, 1.0), 0
    while lines.at(index, "the table in { }") != "{":
        word, *rest = lines.texts[index].split()
        if word not in ("Version", "From", "Length", "Components"):
            raise lines.wrong(index, "not a keyword of .spi1d files")
        if word == "From":
            first, second = lines.floats(index, rest, 2, "From")
            domain = (first, second)
        elif word != "Version":
            limit = MOST_ENTRIES if word == "Length" else 3
            found[word] = lines.integers(index, rest[:1] or ["?"], 1, limit, word)[0]
        index += 1
    if "Length" not in found:
        raise LutError(f"{path}: no Length before the table")
    if domain[0] >= domain[1]:
        raise LutError(f"{path}: From: the range {domain[0]:g} to {domain[1]:g} is empty")
    width = found.get("Components", 1)
    table = lines.table(index + 1, found["Length"], width, "the table")
    if lines.at(index + 1 + len(table), "}") != "}":
        raise lines.wrong(index + 1 + len(table), "expected the table's end, }")
    if width == 2:
        raise LutError(f"{path}: two components; a .spi1d of colours has one or three")
    return Lut((Curve(table + np.zeros(3), *domain),), metadata={"format": ".spi1d"})


def read_spi3d(path: Path, data: bytes) -> Lut:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    if not lines.at(0, "SPILUT").upper().startswith("SPILUT"):  # Blender's own are in lower case
        raise lines.wrong(0, "a .spi3d begins with SPILUT 1.0")
    if lines.at(1, "3 3").split() != ["3", "3"]:
        raise lines.wrong(1, "expected 3 3")
    words = lines.at(2, "the size").split()
    if len(words) != 3:
        raise lines.wrong(2, "expected three sizes")
    r, g, b = lines.integers(2, words, 2, MOST_NODES, "the size")
    table = lines.table(3, r * g * b, 6, "the cube")
    places = table[:, :3]
    if np.any(places != np.rint(places)) or np.any(places < 0) or np.any(places >= [r, g, b]):
        row = int(np.flatnonzero(np.any((places != np.rint(places)) | (places < 0) | (places >= [r, g, b]), axis=1))[0])
        raise lines.wrong(3 + row, "node indices outside the cube")
    cube = np.full((r, g, b, 3), np.nan)
    i, j, k = places.astype(np.int64).T
    cube[i, j, k] = table[:, 3:]
    if not np.all(np.isfinite(cube)):
        raise LutError(f"{path}: some nodes are given twice, others never")
    return Lut((Cube(cube),), metadata={"format": ".spi3d"})


NAME = ".spi1d (shaper) and .spi3d (cube), to be used one after the other"
for _suffix, _read in zip(PAIR, (read_spi1d, read_spi3d), strict=True):
    register(FileFormat(NAME, (_suffix,), ("shaper",), _read, write, size=33))
