"""`.3dl` (Autodesk Flame and Lustre, Kodak): a uniform cube of integers, blue fastest.

Readers tell the depth from the largest number, and some take 12 bits for granted: 12 bits it is.
"""

from pathlib import Path

import numpy as np

from lutforge.luts.formats.text import comment_lines, write_text
from lutforge.luts.sequence import FileFormat, Lut, register


def write(lut: Lut, path: Path) -> None:
    """Write a cube in 12 bits, outputs clamped to [0, 1]. Raises LutError."""
    _, cube = lut.shaper_and_cube()
    mesh = np.rint(np.linspace(0, 1023, lut.size)).astype(int)
    codes = np.rint(np.clip(cube.values, 0.0, 1.0) * 4095).astype(int).reshape(-1, 3)
    header = [*comment_lines(lut.title, lut.comments), " ".join(map(str, mesh.tolist()))]
    body = ("%d %d %d\n" * len(codes)) % tuple(codes.ravel().tolist())
    write_text(path, "\n".join(header) + "\n" + body)


register(FileFormat(".3dl", (".3dl",), ("plain",), write, (17, 33, 65), 33, 12))
