"""`.vlt` (Panasonic VariCam and Lumix bodies): a cube of 17³ nodes in 12-bit integers, red fastest.

Three header lines and a blank one, then a line of three codes 0 … 4095 a node; lines end in line feeds. The layout is
that of the files that Panasonic's cameras write, as LUTCalc describes it
(https://github.com/cameramanben/LUTCalc, js/lut-vlt.js).
"""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError, one_line
from lutforge.luts.formats.text import cube_of_rows, write_text
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


def read(path: Path) -> Lut:
    """Read one. Raises LutError."""
    lines = [line for line in path.read_text("utf-8", "replace").splitlines() if line.strip()]
    comments = tuple(line.lstrip("# ")[:200] for line in lines if line.startswith("#"))
    numbers = [line for line in lines if not line.startswith("#")]
    if numbers[:1] != [f"LUT_3D_SIZE {SIZE}"] or len(numbers) != 1 + SIZE**3:
        raise LutError(f"{path}: a .vlt has the line LUT_3D_SIZE {SIZE}, and {SIZE**3} rows behind it")
    try:
        table = np.loadtxt(numbers[1:], dtype=np.int64, ndmin=2, comments=None)
    except ValueError as error:
        raise LutError(f"{path}: its table is not of whole numbers ({one_line(str(error), 100)})") from error
    if table.shape[1] != 3 or table.min() < 0 or table.max() > TOP:
        raise LutError(f"{path}: its table is not of three whole numbers a row from 0 to {TOP}")
    return Lut((Cube(cube_of_rows(table / TOP, (SIZE, SIZE, SIZE))),), "", comments, {"bits": "12"})


register(FileFormat(".vlt", (".vlt",), ("plain",), write, (SIZE,), SIZE, 12, read=read))
