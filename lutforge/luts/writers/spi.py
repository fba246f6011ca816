"""The .spi1d and .spi3d formats (Sony Imageworks): the shaper and the cube as two files, for OpenColorIO configs."""

from pathlib import Path

import numpy as np

from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.ops import Curve
from lutforge.luts.writers.text import DIGITS, SHAPER_DIGITS, comment_lines, rows, write_text

SPI_PAIR = (".spi1d", ".spi3d")
"""The suffixes of a shaper and a cube that belong together, in the order in which they are used."""


def write_spi(lut: OpSequence, path: Path) -> None:
    """Write both files of a LUT: the shaper, which is straight where there is none, and the cube."""
    shaper, cube = lut.shaper_and_cube()
    curve = shaper or Curve(np.repeat([[0.0], [1.0]], 3, axis=1))
    header = f"Version 1\nFrom {curve.low!r} {curve.high!r}\nLength {len(curve.outputs)}\nComponents 3\n{{\n"
    # Comments come after the tables, since readers count the lines before them.
    comments = "".join(f"{line}\n" for line in comment_lines(lut.title, lut.comments))
    write_text(path.with_suffix(SPI_PAIR[0]), header + rows(curve.outputs, SHAPER_DIGITS) + "}\n" + comments)
    n = cube.size
    index = np.stack(np.meshgrid(*[np.arange(n)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    table = np.concatenate([index, np.round(cube.values.reshape(-1, 3), DIGITS) + 0.0], axis=1)
    body = (f"%d %d %d %.{DIGITS}f %.{DIGITS}f %.{DIGITS}f\n" * len(table)) % tuple(table.ravel().tolist())
    write_text(path.with_suffix(SPI_PAIR[1]), f"SPILUT 1.0\n3 3\n{n} {n} {n}\n" + body + comments)
