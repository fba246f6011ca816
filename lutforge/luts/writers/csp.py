"""The .csp format (Rising Sun Research cineSpace): a prelut with free knots per channel, and a cube.

ffmpeg's lut3d draws straight lines between the knots; OpenColorIO lays a spline through them, hence many.
"""

from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.ops import Cube, Curve
from lutforge.luts.shaper import node_levels
from lutforge.luts.writers.text import plain, rows, rows_of_cube, write_text

KNOTS = 16384
"""Most even steps of a curve that are written."""


def write_csp(lut: OpSequence, path: Path) -> None:
    """Write a cube with a shaper, or none; red varies fastest.

    The prelut holds the knots of a curve with free knots. Of a curve with even steps it holds some steps, the nodes and
    their neighbours: with these OpenColorIO's spline stays within 1e-5 of straight lines.
    """
    curve, cube = lut.shaper_and_cube()
    notes = [line for line in (plain(text) for text in (lut.title, *lut.comments)) if line]
    lines = ["CSPLUTV100", "3D", "", "BEGIN METADATA", *notes, "END METADATA", ""]
    for channel in range(3):
        x, y = _prelut(curve, cube, channel)
        lines += [str(len(x)), " ".join(f"{v:.9f}" for v in x), " ".join(f"{v:.9f}" for v in y)]
    lines += ["", f"{cube.size} {cube.size} {cube.size}"]
    write_text(path, "\n".join(lines) + "\n" + rows(rows_of_cube(cube.values)))


def _prelut(curve: Curve | None, cube: Cube, channel: int) -> tuple[Array, Array]:
    """The knots (m,) of a channel's curve and its values there."""
    if curve is None:
        return np.array([0.0, 1.0]), np.array([0.0, 1.0])
    if curve.inputs is not None:
        return curve.inputs[:, channel], curve.outputs[:, channel]

    # Even steps, and the nodes with their neighbours, since the curve bends at nodes. A short curve gets three more
    # points between two of its entries.
    entries = len(curve.outputs)
    fine = 1 if entries >= KNOTS else 4
    last = fine * (entries - 1)
    span = curve.high - curve.low
    node = fine * np.rint((node_levels(curve, cube)[channel] - curve.low) / span * (entries - 1)).astype(np.int64)
    even = fine * np.linspace(0, entries - 1, min(KNOTS, entries)).astype(np.int64)
    index = np.unique(np.clip(np.concatenate([even, node, node - fine, node + fine, node - 1, node + 1]), 0, last))
    values = np.interp(index, fine * np.arange(entries), curve.outputs[:, channel])
    return curve.low + index / last * span, values
