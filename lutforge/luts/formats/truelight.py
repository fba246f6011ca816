"""`.cub` (FilmLight Truelight cube 2.0, for Baselight): a shaper per channel, in units of nodes, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import comment_lines, rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a LUT without gain, response or matrix; red varies fastest. Raises LutError on any other."""
    if lut.has_gain or lut.has_matrix or lut.response is not None:
        raise LutError(f"{path}: a .cub holds no gain, response or matrix; fold them first")
    notes = [line for line in comment_lines(lut.title, lut.comments) if len(line.split()) > 2]
    header = [
        "# Truelight Cube v2.0",
        *notes,
        f"# lutLength {lut.shaper_size}",
        "# iDims 3",
        "# oDims 3",
        f"# width {lut.size} {lut.size} {lut.size}",
        "",
        "# InputLUT",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    text = "\n".join(header) + "\n" + rows(lut.shaper * (lut.size - 1)) + "\n# Cube\n" + rows(table) + "\n# end\n"
    path.write_text(text, encoding="ascii", newline="\n")
