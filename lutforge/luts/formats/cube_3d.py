"""`.cube`, 3D table only (Adobe Cube LUT Specification 1.0, Iridas): what every reader of .cube takes."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import comment_lines, plain, rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a uniform LUT without gain or matrix; red varies fastest. Raises LutError on any other."""
    if not lut.is_uniform or lut.has_gain or lut.has_matrix:
        raise LutError(f"{path}: a 3D .cube holds a uniform cube only; resample it first")
    header = [
        f'TITLE "{plain(lut.title) or "LutForge"}"',
        *comment_lines("", lut.comments),
        f"LUT_3D_SIZE {lut.size}",
        "DOMAIN_MIN 0.0 0.0 0.0",
        "DOMAIN_MAX 1.0 1.0 1.0",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    path.write_text("\n".join(header) + "\n" + rows(table), encoding="ascii", newline="\n")
