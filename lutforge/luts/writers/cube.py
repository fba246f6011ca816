"""The .cube format: a 3D table (Adobe Cube LUT Specification 1.0, Iridas), a 1D table, or a shaper before a 3D table.

DaVinci Resolve writes the form with a shaper, and OpenColorIO reads it. Its comments come before the header, and there
is no TITLE and no DOMAIN line: OpenColorIO (FileFormatResolveCube) refuses the file otherwise. The input ranges are
written although 0 to 1 is their default: a reader that knows the 3D form only, such as ffmpeg's lut3d, then refuses the
file instead of rendering wrong colours.
"""

from pathlib import Path

from lutforge.luts.op_sequence import OpSequence
from lutforge.luts.writers.photo_style import photo_style
from lutforge.luts.writers.text import SHAPER_DIGITS, comment_lines, plain, rows, rows_of_cube, write_text


def write_cube(lut: OpSequence, path: Path) -> None:
    """Write a cube as the plain 3D form, one with a shaper as Resolve's, a curve as the 1D form; red varies fastest."""
    curve, cube = lut.shaper_and_cube()
    table = rows(rows_of_cube(cube.values))
    if curve is None:
        header = [
            f'TITLE "{plain(lut.title) or "LutForge"}"',
            *photo_style(lut),
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
        ]
        if lut.cube is not None:
            header += [f"LUT_3D_SIZE {cube.size}", "LUT_3D_INPUT_RANGE 0.0 1.0"]
        table = rows(curve.outputs, SHAPER_DIGITS) + (table if lut.cube is not None else "")
    write_text(path, "\n".join(header) + "\n" + table)
