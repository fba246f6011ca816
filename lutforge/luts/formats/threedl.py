"""`.3dl` (Autodesk Flame and Lustre, Kodak): a uniform cube of integers, blue fastest.

Readers tell the depth from the largest number, and some take 12 bits for granted: 12 bits it is.
"""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import comment_lines
from lutforge.luts.lut import Lut

SIZES = (17, 33, 65)
TOP = 4095


def write(lut: Lut, path: Path) -> None:
    """Write a uniform LUT of 17, 33 or 65 nodes, outputs clamped to [0, 1]. Raises LutError on any other."""
    if not lut.is_uniform or lut.has_gain or lut.has_matrix or lut.response is not None or lut.size not in SIZES:
        raise LutError(f"{path}: a .3dl holds a uniform cube of 17, 33 or 65 nodes per axis; choose one of these sizes")
    mesh = np.rint(np.linspace(0, 1023, lut.size)).astype(int)
    codes = np.rint(np.clip(lut.cube, 0.0, 1.0) * TOP).astype(int).reshape(-1, 3)
    header = [*comment_lines(lut.title, lut.comments), " ".join(map(str, mesh.tolist()))]
    body = ("%d %d %d\n" * len(codes)) % tuple(codes.ravel().tolist())
    path.write_text("\n".join(header) + "\n" + body, encoding="ascii", newline="\n")
