"""`.csp` (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube.

ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
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
