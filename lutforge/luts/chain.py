"""A transform as its own steps, each a LUT: what a process list (CLF, CTF) can hold whole.

A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while one
cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping between.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.atomic_write import atomic_path
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake
from lutforge.luts.formats import clf
from lutforge.luts.lut import Lut
from lutforge.model.transform import Refinish, Transform

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LutChain:
    """LUTs applied one after the other."""

    luts: tuple[Lut, ...]

    def __call__(self, x: ArrayLike) -> Array:
        """(…, 3) → (…, 3), as a reader of the file computes it."""
        y = np.asarray(x, dtype=np.float64)
        for lut in self.luts:
            y = lut(y)
        return y

    def write(self, path: str | Path) -> Path:
        """Write .clf or .ctf, atomically. Raises LutError on another suffix."""
        path = Path(path)
        if path.suffix.lower() not in clf.FORMATS:
            raise LutError(f'{path}: only .clf and .ctf hold more than one cube, not "{path.suffix}"')
        with atomic_path(path) as temporary:
            clf.write_all(self.luts, temporary)
        return path


def bake_chain(
    transform: Transform,
    size: int | None = None,
    *,
    interpolation: Interpolation | None = None,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> LutChain:
    """Bake the steps of a transform apart: two LUTs for a refinish or match, one for any other.

    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """
    steps = [transform]
    if isinstance(transform, Refinish):
        steps = [transform.linearize, transform.render]
    luts = [bake(step, size, interpolation=interpolation, display_referred=False) for step in steps]
    if isinstance(transform, Refinish):
        luts[0] = replace(luts[0], matrix=transform.between @ luts[0].matrix, source=None)
    luts[0] = replace(luts[0], title=title, comments=comments)
    return LutChain(tuple(luts))
