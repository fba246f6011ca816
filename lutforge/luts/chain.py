"""A transform as its own steps, each a LUT: what a process list (CLF, CTF) can hold whole.

A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while one
cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping between.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses
from numpy.typing import ArrayLike, NDArray

from lutforge.atomic_write import atomic_path
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake
from lutforge.luts.formats import clf
from lutforge.luts.lut import MAX_SIZE, Lut
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.highlights import RAMP
from lutforge.model.lattice import grid
from lutforge.model.transform import Refinish, Transform

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LutChain:
    """LUTs applied one after the other."""

    luts: tuple[Lut, ...]

    def __call__(self, x: ArrayLike) -> Array:
        """(…, 3) → (…, 3), as a reader of the file computes it."""
        first, *others = self.luts
        y = first(x)
        for lut in others:
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

    def processor(self) -> OCIO.CPUProcessor:
        """The chain as OpenColorIO evaluates it, float32 in and out."""
        group = OCIO.GroupTransform()
        for lut in self.luts:
            for transform in clf.transforms(lut):
                group.appendTransform(transform)
        return OCIO.Config.CreateRaw().getProcessor(group).getOptimizedCPUProcessor(OCIO.OPTIMIZATION_LOSSLESS)


def bake_chain(
    transform: Transform,
    size: int | None = None,
    *,
    interpolation: Interpolation | None = None,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> LutChain:
    """Bake the steps of a transform apart: two LUTs for a refinish or match, one for any other.

    The steps are those of the bare model: between them nothing tells what clipped, so white is not kept neutral.
    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """
    steps = [transform]
    if isinstance(transform, Refinish):
        steps = [transform.linearize, transform.render]
    luts = [bake(step, size, interpolation=interpolation, display_referred=False) for step in steps]
    if isinstance(transform, Refinish):
        luts[0] = _exposed(luts[0], transform)
    luts[0] = replace(luts[0], title=title, comments=comments)
    return LutChain(tuple(luts))


def grading_chain(transform: Refinish, linearize: Lut, render: Lut) -> LutChain:
    """A refinish for photographs, from the baked linearize and render of its two styles, under any white balances: what
    clipped in the source stays neutral.

    The LUTs may be of the same styles under other white balances; only the cube of the first is computed anew, so that
    a picture with a white balance of its own costs milliseconds. It gets one node level more, below which colours are
    the model's.
    """
    wider = _with_level_below_clipping(replace(linearize, matrix=np.eye(3)))
    nodes = grid(wider.levels)
    raw = wider.cube @ np.asarray(getattr(transform.linearize, "matrix", np.eye(3))).T
    cube = replace(transform, neutral_highlights=True).balanced(nodes, raw)
    return LutChain((replace(wider, cube=cube), replace(render, gain=np.ones(3))))


def _exposed(lut: Lut, transform: Refinish) -> Lut:
    """The linearize LUT with what lies between it and the render LUT behind it."""
    if transform.transfer is None:
        return replace(lut, matrix=transform.between @ lut.matrix, source=None)
    return replace(lut, cube=transform.exposed(lut.cube @ lut.matrix.T), matrix=np.eye(3), source=None)


def _with_level_below_clipping(lut: Lut) -> Lut:
    """The same LUT with a node level more per axis, where a channel begins to count as clipped."""
    size, shaper = lut.size, lut.shaper_size
    if lut.is_uniform:
        shaper = (size - 1) * ((SHAPER_SIZE - 1) // (size - 1)) + 1  # the evenly spaced levels lie on its points
    top = np.floor((1.0 - RAMP) * (shaper - 1)) / (shaper - 1)
    r, g, b = (axis if np.any(axis == top) else np.sort(np.append(axis, top)) for axis in lut.levels)
    if not len(r) == len(g) == len(b) <= MAX_SIZE:
        r, g, b = lut.levels
        shaper = lut.shaper_size
    cube = lut(grid((r, g, b)))
    return replace(lut, levels=(r, g, b), shaper_size=shaper, cube=cube, response=None, source=None)
