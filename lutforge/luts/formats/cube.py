"""`.cube`: a 3D table (Adobe Cube LUT Specification 1.0, Iridas), a 1D table, or a shaper in front of a 3D table.

The last is what DaVinci Resolve writes and OpenColorIO reads. Comments come before its header, and there is no TITLE
and no DOMAIN line: OpenColorIO (FileFormatResolveCube) refuses the file otherwise. The input ranges, whose default is 0
to 1, are written out: a reader that knows the 3D form only, such as ffmpeg's lut3d, then refuses the file instead of
rendering garbage.
"""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import (
    MOST_ENTRIES,
    MOST_NODES,
    Lines,
    comment_lines,
    cube_of_rows,
    is_numeric,
    plain,
    rows,
    rows_of_cube,
    write_text,
)
from lutforge.luts.ops import Cube, Curve, Matrix, Op
from lutforge.luts.sequence import FileFormat, Lut, register

RANGES = ("LUT_1D_INPUT_RANGE", "LUT_3D_INPUT_RANGE")


def write(lut: Lut, path: Path) -> None:
    """Write a cube as the plain 3D form, one with a shaper as Resolve's, a curve as the 1D form; red varies fastest.

    Raises LutError.
    """
    curve, cube = lut.shaper_and_cube()
    table = rows(rows_of_cube(cube.values))
    if lut.cube is None and curve is not None:
        table = ""
        header = [
            *comment_lines(lut.title, lut.comments),
            f"LUT_1D_SIZE {len(curve.outputs)}",
            f"LUT_1D_INPUT_RANGE {curve.low!r} {curve.high!r}",
        ]
    elif curve is None:
        header = [
            f'TITLE "{plain(lut.title) or "LutForge"}"',
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
            f"LUT_3D_SIZE {cube.size}",
            "LUT_3D_INPUT_RANGE 0.0 1.0",
        ]
    shaper = "" if curve is None else rows(curve.outputs)
    write_text(path, "\n".join(header) + "\n" + shaper + table)


def read(path: Path, data: bytes) -> Lut:
    """Read any of the three. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    sizes: dict[str, int] = {}
    pairs: dict[str, list[float]] = {}
    title, keywords, index = "", [], 0
    while index < len(lines) and not is_numeric(lines.texts[index]):
        word, *rest = lines.texts[index].split()
        keywords.append(word)
        if word == "TITLE":
            title = lines.texts[index][5:].strip().strip('"')
        elif word in ("LUT_1D_SIZE", "LUT_3D_SIZE"):
            if len(rest) != 1:
                raise lines.wrong(index, f"{word} takes one number")
            (sizes[word],) = lines.integers(index, rest, 2, MOST_ENTRIES if word == "LUT_1D_SIZE" else MOST_NODES, word)
        elif word in (*RANGES, "DOMAIN_MIN", "DOMAIN_MAX"):
            pairs[word] = lines.floats(index, rest, 2 if word in RANGES else 3, word)
        else:
            raise lines.wrong(index, "not a keyword of .cube files")
        index += 1
    entries, size = sizes.get("LUT_1D_SIZE", 0), sizes.get("LUT_3D_SIZE", 0)
    if not entries and not size:
        raise LutError(f"{path}: neither LUT_1D_SIZE nor LUT_3D_SIZE; not a .cube file")
    domain = np.array([pairs.get("DOMAIN_MIN", [0.0] * 3), pairs.get("DOMAIN_MAX", [1.0] * 3)])
    ranges = {name: np.repeat(np.array([pairs[name]]).T, 3, axis=1) for name in RANGES if name in pairs}
    for name, (low, high) in (*ranges.items(), ("DOMAIN", domain)):
        if not np.all(low < high):
            span = f"{low.min():g} to {high.max():g}"
            raise LutError(f"{path}: {name}: the range {span} is empty; write it from low to high")
    ops: list[Op] = []
    if entries:
        table = lines.table(index, entries, 3, "the 1D table")
        ops += _curve(table, ranges.get("LUT_1D_INPUT_RANGE", domain))
    if size:
        between = np.array([[0.0] * 3, [1.0] * 3]) if entries else domain
        ops += _to_unit(ranges.get("LUT_3D_INPUT_RANGE", between))
        ops.append(Cube(cube_of_rows(lines.table(index + entries, size**3, 3, "the 3D table"), (size, size, size))))
    if len(lines) > index + entries + size**3:
        raise lines.wrong(index + entries + size**3, f"more rows than the {entries + size**3} that the header says")
    return Lut(tuple(ops), title, tuple(lines.comments), {"keywords": " ".join(keywords)})


def _curve(table: np.ndarray, domain: np.ndarray) -> list[Op]:
    """Return a table over a domain (2, 3) as a curve; where the domain differs by channel, with a matrix in front."""
    if np.ptp(domain, axis=1).max() == 0:
        return [Curve(table, float(domain[0, 0]), float(domain[1, 0]))]
    return [*_to_unit(domain), Curve(table)]


def _to_unit(domain: np.ndarray) -> list[Op]:
    """A matrix that takes a domain (2, 3) to [0, 1], where it is another."""
    span = domain[1] - domain[0]
    matrix = Matrix(np.diag(1 / span), -domain[0] / span)
    return [] if matrix.is_identity else [matrix]


register(FileFormat(".cube", (".cube",), ("plain", "shaper"), read, write))
