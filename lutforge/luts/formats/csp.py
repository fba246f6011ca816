"""`.csp` (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube.

ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.luts.contents import Curve, LutContents
from lutforge.luts.formats.lines import LONGEST_CURVE, MAX_CURVE, MAX_SIZE, Lines, red_fastest
from lutforge.luts.formats.text import plain, rows
from lutforge.luts.lut import Lut

Array = NDArray[np.float64]

KNOTS = 16384
"""Even knots of a prelut, beside those where the shaper has a corner."""


def write(lut: Lut, path: Path) -> None:
    """Write a LUT without gain, response or matrix; red varies fastest. Raises LutError on any other."""
    if lut.has_gain or lut.has_matrix or lut.response is not None:
        raise LutError(f"{path}: a .csp holds no gain, response or matrix; fold them first")
    notes = [line for line in (plain(text) for text in (lut.title, *lut.comments)) if line]
    lines = ["CSPLUTV100", "3D", "", "BEGIN METADATA", *notes, "END METADATA", ""]
    shaper = lut.shaper
    for channel in range(3):
        x, y = ([0.0, 1.0], [0.0, 1.0]) if lut.is_uniform else _knots(lut, shaper, channel)
        lines += [str(len(x)), " ".join(f"{v:.9f}" for v in x), " ".join(f"{v:.9f}" for v in y)]
    lines += ["", f"{lut.size} {lut.size} {lut.size}"]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    path.write_text("\n".join(lines) + "\n" + rows(table), encoding="ascii", newline="\n")


def _knots(lut: Lut, shaper: Array, channel: int) -> tuple[list[float], list[float]]:
    """Points of the shaper's own grid: even ones, the node levels, and their neighbours."""
    last = lut.shaper_size - 1
    level = np.rint(lut.levels[channel] * last).astype(np.int64)
    even = np.linspace(0, last, min(KNOTS, last + 1)).astype(np.int64)
    index = np.unique(np.clip(np.concatenate([even, level, level - 1, level + 1]), 0, last))
    x, y = index / last * lut.highest, shaper[index, channel]
    return x.tolist(), y.tolist()


def read(path: Path, data: bytes) -> LutContents:
    """Read one. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data, LONGEST_CURVE)
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
    inputs: list[list[float]] = []
    outputs: list[list[float]] = []
    for channel in "RGB":
        what = f"the {channel} prelut"
        (count,) = lines.integers(index, lines.at(index, what).split()[:1], 2, 1 << 16, what)
        for offset, store in ((1, inputs), (2, outputs)):
            lines.at(index + offset, what)
            store.append(lines.floats(index + offset, lines.texts[index + offset].split(), count, what))
        if np.any(np.diff(inputs[-1]) <= 0):
            raise lines.wrong(index + 1, f"{what}: its inputs do not increase")
        index += 3
    domain = tuple(knots[0] for knots in inputs), tuple(knots[-1] for knots in inputs)
    shaper = None
    if any(len(knots) > 2 or values != [0.0, 1.0] for knots, values in zip(inputs, outputs, strict=True)):
        even = np.linspace(0.0, 1.0, 4096)
        sampled = [
            np.interp(knots[0] + even * (knots[-1] - knots[0]), knots, values)
            for knots, values in zip(inputs, outputs, strict=True)
        ]
        shaper = Curve(np.stack(sampled, axis=1), domain=(domain[0][0], domain[1][0]))
    words = lines.at(index, "the size").split()
    (low_r, low_g, low_b), (high_r, high_g, high_b) = domain
    common = ((low_r, low_g, low_b), (high_r, high_g, high_b))
    if kind == "1D":
        (entries,) = lines.integers(index, words[:1], 2, MAX_CURVE, "the size")
        return LutContents(
            ".csp", "1D", "", tuple(notes), None, Curve(lines.table(index + 1, entries, 3, "the table")), None, common
        )
    if len(words) != 3:
        raise lines.wrong(index, "expected three sizes")
    r, g, b = lines.integers(index, words, 2, MAX_SIZE, "the size")
    cube = red_fastest(lines.table(index + 1, r * g * b, 3, "the cube"), (r, g, b))
    return LutContents(".csp", "prelut + 3D", "", tuple(notes), cube, shaper, None, common)
