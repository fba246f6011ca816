"""`.spi1d` and `.spi3d` (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import rows
from lutforge.luts.lut import Lut


def write_spi1d(lut: Lut, path: Path) -> None:
    """Write the shaper of a LUT."""
    header = f"Version 1\nFrom 0.0 {lut.highest!r}\nLength {lut.shaper_size}\nComponents 3\n{{\n"
    path.write_text(header + rows(lut.shaper) + "}\n", encoding="ascii", newline="\n")


def write_spi3d(lut: Lut, path: Path) -> None:
    """Write the cube of a LUT, to be read behind its shaper. Raises LutError on a gain or matrix."""
    if lut.has_gain or lut.has_matrix:
        raise LutError(f"{path}: a .spi3d holds no gain and no matrix; fold them first")
    n = lut.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(lut.cube.reshape(-1, 3), 10) + 0.0], axis=1)
    body = ("%d %d %d %.10f %.10f %.10f\n" * len(table)) % tuple(table.ravel().tolist())
    path.write_text(f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body, encoding="ascii", newline="\n")
