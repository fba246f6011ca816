"""`.spi1d` and `.spi3d` (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import MAX_CURVE, MAX_SIZE, Lines
from lutforge.luts.formats.text import rows
from lutforge.luts.lut import Lut


def write_spi1d(lut: Lut, path: Path) -> None:
    """Write the shaper of a LUT."""
    header = f"Version 1\nFrom 0.0 {lut.highest!r}\nLength {lut.shaper_size}\nComponents 3\n{{\n"
    path.write_text(header + rows(lut.shaper) + "}\n", encoding="ascii", newline="\n")


def write_spi3d(lut: Lut, path: Path) -> None:
    """Write the cube of a LUT, to be read behind its shaper. Raises LutError on a gain or matrix."""
    if lut.has_gain or lut.has_matrix:
        raise LutError(f"{path}: a .spi3d holds no gain and no matrix; fold them first")
    n = lut.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(lut.cube.reshape(-1, 3), 10) + 0.0], axis=1)
    body = ("%d %d %d %.10f %.10f %.10f\n" * len(table)) % tuple(table.ravel().tolist())
    path.write_text(f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body, encoding="ascii", newline="\n")


def read_spi1d(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    found: dict[str, list[str]] = {}
    domain, index = (0.0, 1.0), 0
    while lines.at(index, "the table in { }") != "{":
        word, *rest = lines.texts[index].split()
        if word not in ("Version", "From", "Length", "Components"):
            raise lines.wrong(index, "not a keyword of .spi1d files")
        found[word] = rest
        if word == "From":
            first, second = lines.floats(index, rest, 2, "From")
            domain = (first, second)
        elif word != "Version":
            limit = MAX_CURVE if word == "Length" else 3
            lines.integers(index, rest[:1] or ["?"], 1, limit, word)
        index += 1
    if "Length" not in found:
        raise LutError(f"{path}: no Length before the table")
    if domain[0] >= domain[1]:
        raise LutError(f"{path}: From: the range {domain[0]:g} to {domain[1]:g} is empty")
    width = int(found["Components"][0]) if "Components" in found else 1
    table = lines.table(index + 1, int(found["Length"][0]), width, "the table")
    if lines.at(index + 1 + len(table), "}") != "}":
        raise lines.wrong(index + 1 + len(table), "expected the table's end, }")
    low, high = domain
    return LutContents(".spi1d", "1D", shaper=Curve(table, domain=domain), domain=((low,) * 3, (high,) * 3))


def read_spi3d(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    if not lines.at(0, "SPILUT").upper().startswith("SPILUT"):  # Blender's own are in lower case
        raise lines.wrong(0, "a .spi3d begins with SPILUT 1.0")
    if lines.at(1, "3 3").split() != ["3", "3"]:
        raise lines.wrong(1, "expected 3 3")
    words = lines.at(2, "the size").split()
    if len(words) != 3:
        raise lines.wrong(2, "expected three sizes")
    r, g, b = lines.integers(2, words, 2, MAX_SIZE, "the size")
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
    return LutContents(".spi3d", "3D", cube=cube)
