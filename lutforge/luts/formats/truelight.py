"""`.cub` (FilmLight Truelight cube 2.0, for Baselight): a shaper per channel, in units of nodes, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import MAX_CURVE, MAX_SIZE, Lines, red_fastest
from lutforge.luts.formats.text import comment_lines, rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a LUT without gain, response or matrix; red varies fastest. Raises LutError on any other."""
    if lut.has_gain or lut.has_matrix or lut.response is not None:
        raise LutError(f"{path}: a .cub holds no gain, response or matrix; fold them first")
    notes = [line for line in comment_lines(lut.title, lut.comments) if len(line.split()) > 2]
    header = [
        "# Truelight Cube v2.0",
        *notes,
        f"# lutLength {lut.shaper_size}",
        "# iDims 3",
        "# oDims 3",
        f"# width {lut.size} {lut.size} {lut.size}",
        "",
        "# InputLUT",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    text = "\n".join(header) + "\n" + rows(lut.shaper * (lut.size - 1)) + "\n# Cube\n" + rows(table) + "\n# end\n"
    path.write_text(text, encoding="ascii", newline="\n")


def read(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
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

    r, g, b = whole("width", 2, MAX_SIZE, 3)
    (entries,) = whole("lutLength", 2, MAX_CURVE, 1) if "InputLUT" in header else (0,)
    shaper = None
    if entries:
        nodes = np.array([r - 1, g - 1, b - 1], dtype=np.float64)
        shaper = Curve(lines.table(0, entries, 3, "InputLUT") / nodes)
    cube = red_fastest(lines.table(entries, r * g * b, 3, "Cube"), (r, g, b))
    return LutContents("Truelight .cub", "shaper + 3D", comments=tuple(lines.comments), cube=cube, shaper=shaper)
