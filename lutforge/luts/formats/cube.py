"""`.cube`: a 3D table (Adobe Cube LUT Specification 1.0, Iridas), a 1D table, or a shaper in front of a 3D table.

The last is what DaVinci Resolve writes and OpenColorIO reads. Comments come before its header, and there is no TITLE
and no DOMAIN line: OpenColorIO (FileFormatResolveCube) refuses the file otherwise. The input ranges, whose default is 0
to 1, are written out: a reader that knows the 3D form only, such as ffmpeg's lut3d, then refuses the file instead of
rendering garbage.
"""

from pathlib import Path

from lutforge.luts.formats.text import comment_lines, plain, rows, rows_of_cube, write_text
from lutforge.luts.sequence import FileFormat, Lut, register


def write(lut: Lut, path: Path) -> None:
    """Write a cube as the plain 3D form, one with a shaper as Resolve's, a curve as the 1D form; red varies fastest.

    Raises LutError.
    """
    curve, cube = lut.shaper_and_cube()
    table = rows(rows_of_cube(cube.values))
    if lut.cube is None and curve is not None:
        table = ""
        header = [
            *comment_lines(lut.title, lut.comments),
            f"LUT_1D_SIZE {len(curve.outputs)}",
            f"LUT_1D_INPUT_RANGE {curve.low!r} {curve.high!r}",
        ]
    elif curve is None:
        header = [
            f'TITLE "{plain(lut.title) or "LutForge"}"',
            *comment_lines("", lut.comments),
            f"LUT_3D_SIZE {cube.size}",
            "DOMAIN_MIN 0.0 0.0 0.0",
            "DOMAIN_MAX 1.0 1.0 1.0",
        ]
    else:
        header = [
            *comment_lines(lut.title, lut.comments),
            f"LUT_1D_SIZE {len(curve.outputs)}",
            f"LUT_1D_INPUT_RANGE {curve.low!r} {curve.high!r}",
            f"LUT_3D_SIZE {cube.size}",
            "LUT_3D_INPUT_RANGE 0.0 1.0",
        ]
    shaper = "" if curve is None else rows(curve.outputs)
    write_text(path, "\n".join(header) + "\n" + shaper + table)


register(FileFormat(".cube", (".cube",), ("plain", "shaper"), write))
