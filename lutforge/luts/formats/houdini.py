"""`.lut` (SideFX Houdini, version 3): one shaper for all three channels, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import (
    MOST_ENTRIES,
    MOST_NODES,
    Lines,
    cube_of_rows,
    is_numeric,
    rows,
    rows_of_cube,
    write_text,
)
from lutforge.luts.ops import Cube, Curve, Op
from lutforge.luts.sequence import FileFormat, Lut, register


def write(lut: Lut, path: Path) -> None:
    """Write a cube, and in front of it one curve for all channels, or none. Raises LutError."""
    curve, cube = lut.shaper_and_cube()
    kind = "Type\t\t3D" if curve is None else "Type\t\t3D+1D"
    length = str(cube.size) if curve is None else f"{cube.size} {len(curve.outputs)}"
    lines = [
        "Version\t\t3",
        "Format\t\tany",
        kind,
        "From\t\t0.000000 1.000000",
        "To\t\t0.000000 1.000000",
        "Black\t\t0.000000",
        "White\t\t1.000000",
        f"Length\t\t{length}",
        "LUT:",
    ]
    text, table = "\n".join(lines) + "\n", rows(rows_of_cube(cube.values))
    if curve is None:
        text += " {\n" + table + "}\n"
    else:
        text += "Pre {\n" + "".join(f"{v:.10f}\n" for v in curve.outputs[:, 0].tolist()) + "}\n3D {\n" + table + "}\n"
    write_text(path, text)


def read(path: Path, data: bytes) -> Lut:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    if lines.at(0, "Version").split()[0].lower() != "version":
        raise lines.wrong(0, "a Houdini .lut begins with Version")
    header: dict[str, tuple[int, list[str]]] = {}
    index = 0
    while lines.at(index, "LUT:").lower() != "lut:":
        word, *rest = lines.texts[index].split()
        header[word.lower()] = (index, rest)
        index += 1
    kind = " ".join(header.get("type", (0, []))[1]).lower()
    if kind not in ("3d", "3d+1d", "c", "rgb", "rgba", "all", "a"):
        raise LutError(f'{path}: Type "{kind[:20]}" is none of 3D, 3D+1D, RGB, C')
    if "length" not in header or not header["length"][1]:
        raise LutError(f"{path}: no Length before LUT:")
    at, words = header["length"]
    domain = (0.0, 1.0)
    if "from" in header:
        place, pair = header["from"]
        first, second = lines.floats(place, pair, 2, "From")
        domain = (first, second)
        if first >= second:
            raise lines.wrong(place, "the range is empty")
    body = [i for i in range(index + 1, len(lines)) if is_numeric(lines.texts[i])]
    marks = [i for i in range(index + 1, len(lines)) if not is_numeric(lines.texts[i])]
    for i in marks:
        if lines.texts[i].replace(" ", "") not in ("{", "}", "Pre{", "3D{", "RGB{", "C{", "A{", "R{", "G{", "B{"):
            raise lines.wrong(i, "not a line of Houdini LUTs")
    low, high = domain
    ops: list[Op] = []
    if not kind.startswith("3d"):
        (entries,) = lines.integers(at, words[:1], 2, MOST_ENTRIES, "Length")
        if not body:
            raise LutError(f"{path}: no rows of numbers")
        table = lines.table(body[0], min(entries, len(body)), 1, "the curve")
        return Lut((Curve(np.repeat(table, 3, axis=1), low, high),))
    (size,) = lines.integers(at, words[:1], 2, MOST_NODES, "Length")
    entries = lines.integers(at, words[1:2] or ["?"], 2, MOST_ENTRIES, "Length")[0] if kind == "3d+1d" else 0
    if len(body) != entries + size**3:
        raise LutError(f"{path}: expected {entries + size**3} rows of numbers, found {len(body)}")
    if entries:
        ops.append(Curve(np.repeat(lines.table(body[0], entries, 1, "Pre"), 3, axis=1), low, high))
    elif domain != (0.0, 1.0):
        ops.append(Curve(np.repeat([[0.0], [1.0]], 3, axis=1), low, high))
    ops.append(Cube(cube_of_rows(lines.table(body[entries], size**3, 3, "3D"), (size, size, size))))
    return Lut(tuple(ops))


register(FileFormat("Houdini .lut", (".lut",), ("shared",), read, write, size=33, inputs="unit"))
