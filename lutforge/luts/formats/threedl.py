"""`.3dl` (Autodesk Flame and Lustre, Kodak): a uniform cube of integers, blue fastest.

Readers tell the depth from the largest number, and some take 12 bits for granted: 12 bits it is.
"""

from pathlib import Path

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.formats.text import MOST_NODES, Lines, comment_lines, is_numeric, write_text
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import FileFormat, Lut, register


def write(lut: Lut, path: Path) -> None:
    """Write a cube in 12 bits, outputs clamped to [0, 1]. Raises LutError."""
    _, cube = lut.shaper_and_cube()
    mesh = np.rint(np.linspace(0, 1023, lut.size)).astype(int)
    codes = np.rint(np.clip(cube.values, 0.0, 1.0) * 4095).astype(int).reshape(-1, 3)
    header = [*comment_lines(lut.title, lut.comments), " ".join(map(str, mesh.tolist()))]
    body = ("%d %d %d\n" * len(codes)) % tuple(codes.ravel().tolist())
    write_text(path, "\n".join(header) + "\n" + body)


def read(path: Path, data: bytes) -> Lut:
    """Read a .3dl file. Raises LutError: file, line, text and cause in one line."""
    lines = Lines(path, data)
    index = 0
    while index < len(lines) and lines.texts[index].split()[0].upper() in ("3DMESH", "MESH"):  # Lustre's header
        index += 1
    if index < len(lines) and not is_numeric(lines.texts[index]):
        raise lines.wrong(index, "not a line of .3dl files")
    mesh = lines.at(index, "the mesh line").split()
    size = len(mesh)
    if not 2 <= size <= MOST_NODES or size == 3:
        raise lines.wrong(index, f"the mesh line has {size} numbers")
    lines.integers(index, mesh, 0, 1 << 20, "the mesh")
    table = lines.codes(index + 1, size**3, np.inf, "the cube")
    top = float(table.max())
    bits = next((depth for depth in (8, 10, 12, 16) if top < 2**depth), None)
    if bits is None:
        raise LutError(f"{path}: a value of {top:g}; a .3dl holds up to 16 bits")
    cube = Cube(table.reshape(size, size, size, 3) / (2**bits - 1))
    header = " ".join(text.split()[0].upper() for text in lines.texts[:index])
    return Lut((cube,), "", tuple(lines.comments), {"bits": str(bits), "keywords": header})


register(FileFormat(".3dl", (".3dl",), ("plain",), read, write, (17, 33, 65), 33, 12))
