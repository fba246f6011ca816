"""`.vlt` (Panasonic VariCam and Lumix bodies): a cube of 17³ nodes in 12-bit integers, red fastest.

Three header lines and a blank one, then a line of three codes 0 … 4095 a node; lines end in line feeds. The layout is
that of the files that Panasonic's cameras write, as LUTCalc describes it
(https://github.com/cameramanben/LUTCalc, js/lut-vlt.js).
"""

from pathlib import Path

import numpy as np

from lutforge.luts.formats.text import Lines, cube_of_rows, write_text
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import FileFormat, Lut, register

SIZE, TOP = 17, 4095
HEADER = ("# panasonic vlt file version 1.0", '# source vlt file ""', f"LUT_3D_SIZE {SIZE}")


def write(lut: Lut, path: Path) -> None:
    """Write a cube in 12 bits, outputs clamped to [0, 1]."""
    _, cube = lut.shaper_and_cube()
    codes = np.rint(np.clip(cube.values, 0.0, 1.0) * TOP).astype(int)
    flat = codes.transpose(2, 1, 0, 3).ravel().tolist()
    write_text(path, "\n".join(HEADER) + "\n\n" + ("%d %d %d\n" * SIZE**3) % tuple(flat))


def read(path: Path, data: bytes) -> Lut:
    """Read a .vlt file. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    if lines.at(0, "the size").split() != ["LUT_3D_SIZE", str(SIZE)]:
        raise lines.wrong(0, f"a .vlt begins with LUT_3D_SIZE {SIZE}")
    table = lines.codes(1, SIZE**3, TOP, "the cube")
    cube = Cube(cube_of_rows(table / TOP, (SIZE, SIZE, SIZE)))
    return Lut((cube,), "", tuple(lines.comments), {"bits": "12"})


register(FileFormat(".vlt", (".vlt",), ("plain",), read, write, (SIZE,), SIZE, 12))
