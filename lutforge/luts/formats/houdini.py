"""`.lut` (SideFX Houdini, version 3): one shaper for all three channels, and a cube."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import rows
from lutforge.luts.lut import Lut


def write(lut: Lut, path: Path) -> None:
    """Write a LUT whose axes share their levels, without gain, response or matrix. Raises LutError on any other."""
    shaper = lut.shaper
    if lut.has_gain or lut.has_matrix or lut.response is not None or np.ptp(shaper, axis=1).max() > 1e-9:
        raise LutError(f"{path}: a Houdini .lut holds one shaper for all channels, and no gain, response or matrix")
    kind = "Type\t\t3D" if lut.is_uniform else "Type\t\t3D+1D"
    length = str(lut.size) if lut.is_uniform else f"{lut.size} {lut.shaper_size}"
    lines = [
        "Version\t\t3",
        "Format\t\tany",
        kind,
        "From\t\t0.000000 1.000000",
        "To\t\t0.000000 1.000000",
        "Black\t\t0.000000",
        "White\t\t1.000000",
        f"Length\t\t{length}",
        "LUT:",
    ]
    table = np.ascontiguousarray(lut.cube.transpose(2, 1, 0, 3)).reshape(-1, 3)
    text = "\n".join(lines) + "\n"
    if lut.is_uniform:
        text += " {\n" + rows(table) + "}\n"
    else:
        text += "Pre {\n" + "".join(f"{v:.10f}\n" for v in shaper[:, 0].tolist()) + "}\n3D {\n" + rows(table) + "}\n"
    path.write_text(text, encoding="ascii", newline="\n")
