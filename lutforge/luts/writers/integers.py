"""The .3dl (Autodesk Flame and Lustre, Kodak) and .vlt (Panasonic VariCam and Lumix bodies) formats: 12-bit cubes.

Readers of .3dl infer the depth from the largest number, and some assume 12 bits, so 12 bits are written. A .vlt has 17³
nodes, red fastest, after three header lines and a blank one, as LUTCalc describes the files that Panasonic's cameras
write (https://github.com/cameramanben/LUTCalc, js/lut-vlt.js); comments of LutForge come before the third line.
"""

from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.input_and_output import read_input_and_output
from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.writers.photo_style import photo_style
from lutforge.luts.writers.text import comment_lines, rows_of_cube, write_text

TOP = 4095
"""The largest number of 12 bits."""

VLT_SIZE = 17
"""Nodes per axis of a .vlt."""

VLT_HEADER = ("# panasonic vlt file version 1.0", '# source vlt file ""', f"LUT_3D_SIZE {VLT_SIZE}")


def _integer_rows(table: Array) -> str:
    """Rows (n, 3) clamped to [0, 1], as 12-bit integers."""
    codes = np.rint(np.clip(table, 0.0, 1.0) * TOP).astype(int)
    return ("%d %d %d\n" * len(codes)) % tuple(codes.ravel().tolist())


def write_3dl(lut: OpSequence, path: Path) -> None:
    """Write a cube in 12 bits, blue fastest, outputs clamped to [0, 1]."""
    _, cube = lut.shaper_and_cube()
    mesh = np.rint(np.linspace(0, 1023, lut.size)).astype(int)
    header = [*comment_lines(lut.title, lut.comments), " ".join(map(str, mesh.tolist()))]
    write_text(path, "\n".join(header) + "\n" + _integer_rows(cube.values.reshape(-1, 3)))


def write_vlt(lut: OpSequence, path: Path) -> None:
    """Write a cube in 12 bits, outputs clamped to [0, 1].

    Some readers accept no comments but Panasonic's two; others are written only where they state the LUT's input.
    """
    _, cube = lut.shaper_and_cube()
    described = read_input_and_output(lut.comments) is not None
    comments = [*photo_style(lut), *(comment_lines(lut.title, lut.comments) if described else [])]
    header = [*VLT_HEADER[:-1], *comments, VLT_HEADER[-1]]
    write_text(path, "\n".join(header) + "\n\n" + _integer_rows(rows_of_cube(cube.values)))
