"""The LUT files of a config: CLF, as small as text can be without a visible loss.

A config is loaded by every program at every start, so its files hold 4096 entries a curve and numbers of six decimals
and five digits, without the spaces that line them up: an error below 1e-5 of the encoded scale.
"""

from dataclasses import replace
from xml.dom import minidom

import numpy as np

from lutforge.arrays import Array
from lutforge.interpolation import interpolate
from lutforge.luts.axes import FEW, node_levels, shaper
from lutforge.luts.formats import clf
from lutforge.luts.formats.text import short_rows
from lutforge.luts.ops import Cube, Curve, Op
from lutforge.luts.sequence import Lut
from lutforge.model.lattice import grid, snap_levels

DECIMALS, DIGITS = 6, 5


def compact(lut: Lut) -> Lut:
    """The LUT as its file holds it: node levels and curves on FEW points, numbers rounded."""
    ops = list(lut.ops)
    at = next(number for number, op in enumerate(ops) if isinstance(op, Cube))
    cube, front = ops[at], ops[at - 1] if at > 0 else None
    assert isinstance(cube, Cube)
    if isinstance(front, Curve) and len(front.outputs) > FEW:
        levels = node_levels(front, cube)
        if np.abs(shaper(levels, len(front.outputs)).outputs - front.outputs).max() < 1e-9:  # no more than levels
            r, g, b = (snap_levels(axis, FEW) for axis in levels)
            cube = Cube(interpolate(grid((r, g, b)), levels, cube.values, cube.interpolation), cube.interpolation)
            ops[at - 1] = shaper((r, g, b), FEW)
        else:
            ops[at - 1] = _resampled(front)
    ops[at] = Cube(rounded(cube.values), cube.interpolation)
    for number, op in enumerate(ops[at + 1 :], at + 1):
        if isinstance(op, Curve):
            ops[number] = Curve(rounded(_resampled(op).outputs), op.low, op.high)
    return replace(lut, ops=tuple(ops))


def _resampled(curve: Curve) -> Curve:
    """A curve of at most FEW entries."""
    if len(curve.outputs) <= FEW:
        return curve
    even = np.linspace(curve.low, curve.high, FEW)[:, None].repeat(3, axis=1)
    return Curve(curve(even), curve.low, curve.high)


def rounded(values: Array) -> Array:
    """Numbers to DECIMALS decimals, or DIGITS significant digits where that is less."""
    magnitude = np.floor(np.log10(np.maximum(np.abs(values), 1e-12))) + 1
    decimals = np.clip(DIGITS - magnitude, 0, DECIMALS)
    scale = 10.0**decimals
    return np.asarray(np.rint(values * scale) / scale)


def compact_text(lut: Lut) -> str:
    """The CLF of a compact LUT: one space between the numbers of an array, and those without idle zeros.

    OpenColorIO writes it with two entries an axis, in whose place the tables are put: text of all their numbers takes
    it ten times as long, and it writes one file at a time. The same text for the same LUT. Raises LutError.
    """
    outline = replace(lut, ops=tuple(_ends(op) for op in lut.ops))
    tables = iter([_table(op) for op in lut.ops if isinstance(op, Curve | Cube)])
    document = minidom.parseString(clf.text_of(outline))
    for root in document.getElementsByTagName("ProcessList"):
        root.setAttribute("id", clf.identifier(lut))
    for array in document.getElementsByTagName("Array"):
        is_table = array.getAttribute("dim").startswith("2 ")  # a matrix has three rows
        text = array.firstChild
        assert isinstance(text, minidom.Text)
        numbers = next(tables) if is_table else np.fromstring(text.data, sep=" ").reshape(3, -1)
        array.setAttribute("dim", " ".join(map(str, numbers.shape)))
        text.data = f"\n{short_rows(numbers.reshape(-1, numbers.shape[-1]), DECIMALS)}"
    return document.toxml("UTF-8").decode() + "\n"


def _ends(op: Op) -> Op:
    """The operation with no more of its table than the ends of each axis."""
    match op:
        case Curve():
            return replace(op, outputs=op.outputs[[0, -1]])
        case Cube():
            last = op.size - 1
            return replace(op, values=op.values[::last, ::last, ::last])
    return op


def _table(op: Curve | Cube) -> Array:
    """The numbers of a table as OpenColorIO holds them: of one column where all channels have the same curve."""
    numbers = (op.outputs if isinstance(op, Curve) else op.values).astype(np.float32).astype(np.float64)
    same = isinstance(op, Curve) and not np.ptp(numbers, axis=1).any()
    return numbers[:, :1] if same else numbers
