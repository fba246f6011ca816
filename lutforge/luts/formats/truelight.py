"""`.cub` (FilmLight Truelight cube 2.0, for Baselight): a shaper per channel, in units of nodes, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import (
    MOST_ENTRIES,
    MOST_NODES,
    Lines,
    comment_lines,
    cube_of_rows,
    rows,
    rows_of_cube,
    write_text,
)
from lutforge.luts.ops import Cube, Curve, Op
from lutforge.luts.sequence import FileFormat, Lut, register


def write(lut: Lut, path: Path) -> None:
    """Write a cube with a shaper, which is straight where there is none; red varies fastest. Raises LutError."""
    shaper, cube = lut.shaper_and_cube()
    curve = shaper or Curve(np.repeat([[0.0], [1.0]], 3, axis=1))
    notes = [line for line in comment_lines(lut.title, lut.comments) if len(line.split()) > 2]
    header = [
        "# Truelight Cube v2.0",
        *notes,
        f"# lutLength {len(curve.outputs)}",
        "# iDims 3",
        "# oDims 3",
        f"# width {cube.size} {cube.size} {cube.size}",
        "",
        "# InputLUT",
    ]
    front, table = rows(curve.outputs * (cube.size - 1)), rows(rows_of_cube(cube.values))
    write_text(path, "\n".join(header) + "\n" + front + "\n# Cube\n" + table + "\n# end\n")


def read(path: Path, data: bytes) -> Lut:
    """Read a .cub file. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    header: dict[str, list[str]] = {}
    for comment in lines.comments:
        word, *rest = comment.split() or [""]
        header.setdefault(word, rest)
    if "Truelight" not in header:
        raise LutError(f'{path}: no "# Truelight Cube" line; not a Truelight .cub')

    def whole(word: str, low: int, high: int, count: int) -> list[int]:
        words = header.get(word, [])
        if len(words) != count or not all(w.isascii() and w.isdigit() and len(w) < 9 for w in words):
            raise LutError(f'{path}: "# {word}" needs {count} whole number{"s" if count > 1 else ""}')
        values = [int(w) for w in words]
        if not all(low <= value <= high for value in values):
            raise LutError(f'{path}: "# {word}" is not within {low} to {high}')
        return values

    r, g, b = whole("width", 2, MOST_NODES, 3)
    (entries,) = whole("lutLength", 2, MOST_ENTRIES, 1) if "InputLUT" in header else (0,)
    ops: list[Op] = []
    if entries:
        nodes = np.array([r - 1, g - 1, b - 1], dtype=np.float64)
        ops.append(Curve(lines.table(0, entries, 3, "InputLUT") / nodes))
    ops.append(Cube(cube_of_rows(lines.table(entries, r * g * b, 3, "Cube"), (r, g, b))))
    return Lut(tuple(ops), "", tuple(lines.comments))


register(FileFormat("Truelight .cub", (".cub",), ("shaper",), read, write, size=33, inputs="unit"))
