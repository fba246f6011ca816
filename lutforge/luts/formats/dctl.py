"""`.dctl` (DaVinci Resolve): the shaper in code, and the cube in a `.cube` file beside it.

DCTL is C with macros of its own; DEFINE_LUT and APPLY_LUT read a cube, which need not be compiled into the program
(Blackmagic Design, DaVinci Resolve's Developer/DaVinciCTL README). The shaper is a table of knots, searched by halving.
"""

import re
from pathlib import Path

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError, one_line
from lutforge.luts.formats.text import comment_lines, plain, write_cube, write_text
from lutforge.luts.ops import Curve
from lutforge.luts.reading import read_lut
from lutforge.luts.sequence import FileFormat, Lut

MOST_KNOTS = 2048
"""Knots of the shaper per channel: 48 KB in all, which a GPU keeps in constant memory (64 KB)."""

_CODE = """// DaVinci Resolve DCTL: the shaper of this LUT; its cube is read from {cube}
{comments}
DEFINE_LUT(look, {cube})

#define KNOTS {count}
__CONSTANT__ float INPUTS[3 * KNOTS] = {{
{inputs}
}};
__CONSTANT__ float OUTPUTS[3 * KNOTS] = {{
{outputs}
}};

__DEVICE__ float shaped(float x, int channel)
{{
    int low = channel * KNOTS;
    int high = low + KNOTS - 1;
    if (!(x > INPUTS[low])) return OUTPUTS[low];
    if (x >= INPUTS[high]) return OUTPUTS[high];
    while (high - low > 1)
    {{
        int middle = (low + high) / 2;
        if (x < INPUTS[middle]) high = middle; else low = middle;
    }}
    float share = (x - INPUTS[low]) / (INPUTS[high] - INPUTS[low]);
    return OUTPUTS[low] + share * (OUTPUTS[high] - OUTPUTS[low]);
}}

__DEVICE__ float3 transform(int p_Width, int p_Height, int p_X, int p_Y, float p_R, float p_G, float p_B)
{{
    return APPLY_LUT(shaped(p_R, 0), shaped(p_G, 1), shaped(p_B, 2), look);
}}
"""


def write(lut: Lut, path: Path) -> None:
    """Write the program, and its cube under the same stem with the suffix .cube. Raises LutError."""
    curve, table = lut.shaper_and_cube()
    beside = path.with_suffix(".cube")
    if not re.fullmatch(r"[\w .+-]+", beside.name):
        raise LutError(f"{path}: Resolve finds no cube of this name; use letters, digits, blanks and . _ + -")
    inputs, outputs = knots_of(curve)
    write_cube(Lut((table,), lut.title, lut.comments), beside)
    comments = "\n".join(f"//{line[1:]}" for line in comment_lines(plain(lut.title), lut.comments))
    code = _CODE.format(
        cube=beside.name, comments=comments, count=len(inputs), inputs=_numbers(inputs), outputs=_numbers(outputs)
    )
    write_text(path, code)


def read(path: Path) -> Lut:
    """Read one that LutForge wrote, with its cube. Raises LutError on any other."""
    text = path.read_text("utf-8", "replace")
    name = text.partition("\nDEFINE_LUT(look, ")[2].partition(")\n")[0]
    tables = [text.partition(f"{word}[3 * KNOTS] = {{\n")[2].partition("}")[0] for word in ("INPUTS", "OUTPUTS")]
    try:
        inputs, outputs = (
            np.array([float(word.strip().rstrip("f")) for word in table.split(",")]).reshape(3, -1).T
            for table in tables
        )
    except ValueError:
        raise LutError(f"{path}: a .dctl is a program; only those that LutForge wrote are read") from None
    beside = path.with_name(Path(name).name)
    if beside.suffix != ".cube" or not beside.is_file():
        raise LutError(f"{path}: its cube {one_line(beside.name)} is missing; keep the two files in one folder")
    comments = tuple(line.lstrip("/ ") for line in text.splitlines()[1:] if line.startswith("//"))
    table = read_lut(beside)
    return Lut((Curve(outputs, inputs=inputs), *table.ops), table.title, comments)


def knots_of(curve: Curve | None) -> tuple[Array, Array]:
    """Inputs and outputs (n, 3) of a shaper's knots: those where it bends, at most MOST_KNOTS, where it bends most."""
    if curve is None:
        ends = np.repeat(np.array([[0.0], [1.0]]), 3, axis=1)
        return ends, ends
    table = curve.outputs
    even = np.repeat(np.linspace(curve.low, curve.high, len(table))[:, None], 3, axis=1)
    x = even if curve.inputs is None else curve.inputs
    bend = np.zeros_like(table)
    bend[1:-1] = np.abs(np.diff(table, n=2, axis=0))
    bends = bend > 1e-9
    count = int(2 + bends.sum(axis=0).max())
    if count > MOST_KNOTS:  # a smooth curve: knots spread by the square root of its bend, which evens the error out
        amount = np.cumsum(np.sqrt(bend) + np.sqrt(bend).max(axis=0) * 1e-6, axis=0)
        wanted = np.linspace(0.0, 1.0, MOST_KNOTS)[:, None] * (amount[-1] - amount[0]) + amount[0]
        chosen = [np.unique(np.clip(np.searchsorted(amount[:, c], wanted[:, c]), 0, len(table) - 1)) for c in range(3)]
    else:
        chosen = [np.flatnonzero(bends[:, c]) for c in range(3)]
    chosen = [np.union1d(index, (0, len(table) - 1)) for index in chosen]
    longest = max(map(len, chosen))
    # Other knots of the table fill up the channels that have fewer.
    spare = np.linspace(0, len(table) - 1, min(len(table), 4 * longest)).astype(np.intp)
    filled = [np.union1d(index, np.setdiff1d(spare, index)[: longest - len(index)]) for index in chosen]
    picked = np.stack(filled, axis=1)
    return np.take_along_axis(x, picked, axis=0), np.take_along_axis(table, picked, axis=0)


def _numbers(table: Array) -> str:
    rows = table.T.reshape(-1)
    lines = [", ".join(f"{value:.9g}f" if "." in f"{value:.9g}" or "e" in f"{value:.9g}" else f"{value:.1f}f"
                       for value in rows[start : start + 8]) for start in range(0, len(rows), 8)]  # fmt: skip
    return ",\n".join(lines)


DCTL = FileFormat(".dctl", (".dctl",), ("shaper",), write, size=33, knots=True, read=read)
