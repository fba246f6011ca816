"""`.cube` with a 1D shaper in front of the 3D table, as DaVinci Resolve writes it and OpenColorIO reads it.

Comments come before the header, and there is no TITLE and no DOMAIN line: OpenColorIO (FileFormatResolveCube)
refuses the file otherwise. The input ranges, whose default is 0 to 1, are written out: a reader that knows
the 3D form only, such as ffmpeg's lut3d, then refuses the file instead of rendering garbage.
"""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import comment_lines, rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a LUT without gain or matrix (fold them first). Raises LutError on one that has them."""
    if lut.has_gain or lut.has_matrix or lut.before is not None:
        raise LutError(f"{path}: a .cube holds no gain and no matrix; fold them first")
    header = [
        *comment_lines(lut.title, lut.comments),
        f"LUT_1D_SIZE {lut.shaper_size}",
        f"LUT_1D_INPUT_RANGE 0.0 {lut.highest!r}",
        f"LUT_3D_SIZE {lut.size}",
        "LUT_3D_INPUT_RANGE 0.0 1.0",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    text = "\n".join(header) + "\n" + rows(lut.shaper) + rows(table)
    path.write_text(text, encoding="ascii", newline="\n")
