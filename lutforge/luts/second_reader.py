"""LUT files as colour-science reads and evaluates them: a second opinion beside OpenColorIO's."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation

SUFFIXES = (".cube", ".csp", ".spi1d", ".spi3d")
"""What colour-science 0.4 reads; its reader of CLF is a package of its own, which refuses OCIO's namespace."""
AGREE = 1e-3
"""Two readers of one file may differ by this: float32 in one of them, and a spline through the knots of a .csp."""


def second_reading(path: Path, x: Array, method: Interpolation) -> Array | None:
    """What colour-science makes of colours (n, 3); None where it does not read such files. Raises LutError."""
    # It reads line by line: a 65³ .cube of 11 MB takes about a second.
    if path.suffix.lower() not in SUFFIXES or path.stat().st_size > 24 << 20:
        return None
    import colour  # imported here: it takes a second

    names = {"trilinear": "table_interpolation_trilinear", "tetrahedral": "table_interpolation_tetrahedral"}
    interpolator = getattr(colour.algebra, names[method])
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # it warns of tables that it converts to its own domain
            sequence: Any = colour.read_LUT(str(path), method=_method(path))
            stages = list(sequence) if isinstance(sequence, colour.LUTSequence) else [sequence]
            y = np.asarray(x, dtype=np.float64)
            for stage in stages:
                three = isinstance(stage, colour.LUT3D)
                y = np.asarray(stage.apply(y, interpolator=interpolator) if three else stage.apply(y))
    except (ValueError, TypeError, IndexError, KeyError, AttributeError, AssertionError, RuntimeError) as error:
        raise LutError(f"{path}: colour-science cannot read it: {' '.join(str(error).split())[:200]}") from error
    return y


def disagreement(paths: Sequence[Path], x: Array, first: Array, method: Interpolation) -> float | None:
    """The largest difference of a channel between the first reader's outputs and colour-science's, on some of `x`.

    paths: a file, or those that are used one after the other. None where colour-science does not read such files.
    Raises LutError where the two disagree.
    """
    some = np.linspace(0, len(x) - 1, min(4096, len(x))).astype(np.int64)
    second: Array | None = x[some]
    for path in paths:
        second = None if second is None else second_reading(path, second, method)
    if second is None:
        return None
    difference = np.abs(second - first[some]).max(axis=1)
    worst = int(np.argmax(difference))
    if not difference[worst] <= AGREE:
        raise LutError(
            f"{paths[-1]}: OpenColorIO and colour-science read it differently, by {difference[worst]:.2g} at "
            f"{np.round(x[some][worst], 4).tolist()}: do not trust this file"
        )
    return float(difference[worst])


def _method(path: Path) -> str | None:
    """The Resolve reader for a .cube with a shaper; colour-science would guess, by trying one after the other."""
    if path.suffix.lower() != ".cube":
        return None
    with path.open("rb") as file:
        head = file.read(4096)
    return "Resolve Cube" if b"LUT_1D_SIZE" in head and b"LUT_3D_SIZE" in head else "Iridas Cube"
