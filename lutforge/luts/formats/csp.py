"""`.csp` (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube.

ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.
"""

from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.formats.text import (
    MOST_ENTRIES,
    MOST_NODES,
    Lines,
    cube_of_rows,
    plain,
    rows,
    rows_of_cube,
    write_text,
)
from lutforge.luts.ops import Cube, Curve, Op
from lutforge.luts.sequence import FileFormat, Lut, register
from lutforge.luts.shaper import node_levels


def write(lut: Lut, path: Path) -> None:
    """Write a cube with a shaper, or none; red varies fastest. Raises LutError."""
    curve, cube = lut.shaper_and_cube()
    notes = [line for line in (plain(text) for text in (lut.title, *lut.comments)) if line]
    lines = ["CSPLUTV100", "3D", "", "BEGIN METADATA", *notes, "END METADATA", ""]
    for channel in range(3):
        x, y = (np.array([0.0, 1.0]),) * 2 if curve is None else _knots(curve, cube, channel)
        lines += [str(len(x)), " ".join(f"{v:.9f}" for v in x), " ".join(f"{v:.9f}" for v in y)]
    lines += ["", f"{cube.size} {cube.size} {cube.size}"]
    write_text(path, "\n".join(lines) + "\n" + rows(rows_of_cube(cube.values)))


def _knots(curve: Curve, cube: Cube, channel: int) -> tuple[Array, Array]:
    """Inputs and outputs of a prelut: the knots of a curve, or some of its even steps, the nodes and their neighbours.

    With these OpenColorIO's spline stays within 1e-5 of straight lines.
    """
    y = curve.outputs[:, channel]
    if curve.inputs is not None:
        return curve.inputs[:, channel], y
    last = len(y) - 1
    level = (node_levels(curve, cube)[channel] - curve.low) / (curve.high - curve.low)
    node = np.rint(level * last).astype(np.int64)
    even = np.linspace(0, last, min(16384, last + 1)).astype(np.int64)
    index = np.unique(np.clip(np.concatenate([even, node, node - 1, node + 1]), 0, last))
    return curve.low + index / last * (curve.high - curve.low), y[index]


def read(path: Path, data: bytes) -> Lut:
    """Read a .csp file. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data, longest=2_000_000)  # one holds all knots of a curve
    if lines.at(0, "CSPLUTV100") != "CSPLUTV100":
        raise lines.wrong(0, "a .csp begins with CSPLUTV100")
    kind = lines.at(1, "1D or 3D")
    if kind not in ("1D", "3D"):
        raise lines.wrong(1, "expected 1D or 3D")
    index, notes = 2, []
    if lines.at(index, "the prelut") == "BEGIN METADATA":
        while lines.at(index, "END METADATA") != "END METADATA":
            index += 1
            notes.append(lines.at(index, "END METADATA"))
        index += 1
        notes.pop()
    ops = _prelut(lines, index)
    index += 9
    words = lines.at(index, "the size").split()
    if kind == "1D":
        (entries,) = lines.integers(index, words[:1], 2, MOST_ENTRIES, "the size")
        ops.append(Curve(lines.table(index + 1, entries, 3, "the table")))
    else:
        if len(words) != 3:
            raise lines.wrong(index, "expected three sizes")
        r, g, b = lines.integers(index, words, 2, MOST_NODES, "the size")
        ops.append(Cube(cube_of_rows(lines.table(index + 1, r * g * b, 3, "the cube"), (r, g, b))))
    return Lut(tuple(ops), "", tuple(notes))


def _prelut(lines: Lines, index: int) -> list[Op]:
    """The curve of the three preluts that begin at a line, none where they change nothing."""
    inputs: list[Array] = []
    outputs: list[Array] = []
    for channel in "RGB":
        what = f"the {channel} prelut"
        (count,) = lines.integers(index, lines.at(index, what).split()[:1], 2, 1 << 16, what)
        for offset, store in ((1, inputs), (2, outputs)):
            words = lines.at(index + offset, what).split()
            store.append(np.array(lines.floats(index + offset, words, count, what)))
        if np.any(np.diff(inputs[-1]) <= 0):
            raise lines.wrong(index + 1, f"{what}: its inputs do not increase")
        index += 3
    if all(np.array_equal(table, [0, 1]) for table in (*inputs, *outputs)):
        return []
    most = max(map(len, inputs))
    knots = np.stack([_padded(x, most) for x in inputs], axis=1)
    values = [np.interp(knots[:, c], inputs[c], outputs[c]) for c in range(3)]
    return [Curve(np.stack(values, axis=1), inputs=knots)]


def _padded(knots: Array, count: int) -> Array:
    """Knots with even steps of their widest gap added until there are so many: the curve stays the same."""
    widest = int(np.argmax(np.diff(knots)))
    added = np.linspace(knots[widest], knots[widest + 1], count - len(knots) + 2)[1:-1]
    return np.sort(np.concatenate([knots, added]))


register(FileFormat(".csp", (".csp",), ("shaper",), read, write, size=33, inputs="knots"))
