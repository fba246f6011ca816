"""The reader of .vlt files, which OpenColorIO does not know."""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError, one_line
from lutforge.luts.lut_metadata import LutMetadata
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut
from lutforge.luts.writers.integers import TOP, VLT_HEADER, VLT_SIZE
from lutforge.luts.writers.text import cube_of_rows


def read_vlt(path: Path) -> Lut:
    """Read a .vlt. Raises LutError."""
    lines = [line for line in path.read_text("utf-8", "replace").splitlines() if line.strip()]
    comments = tuple(line.lstrip("# ")[:200] for line in lines if line.startswith("#"))
    numbers = [line for line in lines if not line.startswith("#")]
    if numbers[:1] != [VLT_HEADER[-1]] or len(numbers) != 1 + VLT_SIZE**3:
        raise LutError(f"{path}: a .vlt has the line {VLT_HEADER[-1]}, and {VLT_SIZE**3} rows after it")
    try:
        table = np.loadtxt(numbers[1:], dtype=np.int64, ndmin=2, comments=None)
    except ValueError as error:
        raise LutError(f"{path}: its table is not of whole numbers ({one_line(str(error), 100)})") from error
    if table.shape[1] != 3 or table.min() < 0 or table.max() > TOP:
        raise LutError(f"{path}: its table is not of three whole numbers a row from 0 to {TOP}")
    return Lut((Cube(cube_of_rows(table / TOP, VLT_SIZE)),), "", comments, LutMetadata(bits=12))
