"""`.spi1d` and `.spi3d` (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs."""

from pathlib import Path

import numpy as np

from lutforge.luts.formats.text import rows, write_text
from lutforge.luts.ops import Curve
from lutforge.luts.sequence import FileFormat, Lut, register

PAIR = (".spi1d", ".spi3d")
"""The suffixes of a shaper and a cube that belong together, in the order in which they are used."""


def write(lut: Lut, path: Path) -> None:
    """Write both files of a LUT: the shaper, which is straight where there is none, and the cube. Raises LutError."""
    shaper, cube = lut.shaper_and_cube()
    curve = shaper or Curve(np.repeat([[0.0], [1.0]], 3, axis=1))
    header = f"Version 1\nFrom {curve.low!r} {curve.high!r}\nLength {len(curve.outputs)}\nComponents 3\n{{\n"
    write_text(path.with_suffix(PAIR[0]), header + rows(curve.outputs) + "}\n")
    n = cube.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(cube.values.reshape(-1, 3), 10) + 0.0], axis=1)
    body = ("%d %d %d %.10f %.10f %.10f\n" * len(table)) % tuple(table.ravel().tolist())
    write_text(path.with_suffix(PAIR[1]), f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body)


NAME = ".spi1d (shaper) and .spi3d (cube), to be used one after the other"
register(FileFormat(NAME, PAIR, ("shaper",), write, size=33))
