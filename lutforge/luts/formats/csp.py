"""`.csp` (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube.

ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.
"""

from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.formats.text import plain, rows, rows_of_cube, write_text
from lutforge.luts.ops import Cube, Curve
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


register(FileFormat(".csp", (".csp",), ("shaper",), write, size=33, inputs="knots"))
