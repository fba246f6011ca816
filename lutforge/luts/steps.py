"""The steps of a transform in one sequence: what a process list (CLF, CTF) can hold whole.

A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while one
cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping between.
"""

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake, joined
from lutforge.luts.ops import Cube, Curve, Range
from lutforge.luts.sequence import MAX_SIZE, Lut
from lutforge.luts.shaper import SHAPER_SIZE, node_levels
from lutforge.model.gamut_map import GamutMap
from lutforge.model.highlights import CLIPPED
from lutforge.model.lattice import Lattice, grid
from lutforge.model.transform import Clip, ColourFunction, KeepNeutral, Stage, Transform, through_stages


def bake_steps(
    transform: ColourFunction,
    size: int | None = None,
    *,
    interpolation: Interpolation | None = None,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Lut:
    """Bake a transform with a cube for each of its steps, from one clip to the next.

    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """

    def baked(step: ColourFunction) -> Lut:
        return bake(step, size=size, interpolation=interpolation)

    if isinstance(transform, Transform) and any(isinstance(stage, KeepNeutral) for stage in transform.stages):
        return Lut(joined(grading_lut(transform, baked).ops), title, comments)
    steps = _steps(transform) if isinstance(transform, Transform) else [transform]
    return Lut(joined([op for step in steps for op in baked(step).ops]), title, comments)


def _steps(transform: Transform) -> list[ColourFunction]:
    """The transform cut in front of each clip but the first, and of the matrices and gains in front of that."""
    cuts = [at for at, stage in enumerate(transform.stages) if isinstance(stage, Clip)][1:]
    return [Transform(transform.stages[i:j]) for i, j in zip([0, *cuts], [*cuts, len(transform.stages)], strict=True)]


def grading_lut(transform: Transform, baked: Callable[[Transform], Lut]) -> Lut:
    """A refinish for photographs, from the baked steps of its two styles: white stays neutral.

    baked: returns the LUT of a step that is the same under all white balances: of JPEG → linear, or of white-balanced
    RAW → JPEG. Only the cube of the first is computed anew, so that a picture with a white balance of
    its own costs milliseconds. It gets one node more per axis, where white begins: below it
    colours are the model's. Raises LutError on a transform that keeps no neutrals.
    """
    if transform.is_identity:
        return Lut((Range(),))
    (first, between), linearize, render = grading_steps(transform)
    front, cube, encoded = _with_node(baked(linearize), 1.0 - CLIPPED)
    balanced = first.kept(encoded, through_stages(between, cube.values))
    return Lut((front, Cube(balanced, cube.interpolation), *baked(render).ops))


def grading_steps(transform: Transform) -> tuple[tuple[KeepNeutral, tuple[Stage, ...]], Transform, Transform]:
    """What a refinish for photographs does between its two baked steps, and these: JPEG → linear, linear → JPEG.

    Raises LutError on a transform that keeps no neutrals.
    """
    first = transform.stages[0]
    if not isinstance(first, KeepNeutral):
        raise LutError("LUT: photographs are graded by a refinish that keeps clipped neutrals")
    cut = 1 + next(at for at, stage in enumerate(first.stages) if isinstance(stage, Lattice | GamutMap))
    return (first, first.stages[cut:]), Transform(first.stages[:cut]), Transform(transform.stages[1:])


@lru_cache(4)  # while a slider moves it is the same step
def _with_node(lut: Lut, level: float) -> tuple[Curve, Cube, Array]:
    """A shaper and cube with a node level more per axis, near `level`, where there is none and room for one.

    Returned with the inputs (N, N, N, 3) at the nodes.
    """
    curve, cube = lut.shaper, lut.cube
    if cube is None:
        raise LutError(f"LUT: a shaper and a cube are wanted, not {lut.summary}")
    behind = lut.ops[lut.ops.index(cube) :]
    size = cube.size
    if curve is None:  # the evenly spaced levels lie on its entries
        entries = (size - 1) * ((SHAPER_SIZE - 1) // (size - 1)) + 1
        curve = Curve(np.repeat(np.linspace(0.0, 1.0, entries)[:, None], 3, axis=1))
    last = len(curve.outputs) - 1
    at = curve.outputs[int(np.floor(level * last))]  # (3,), along the axes of the cube
    even = np.linspace(0.0, 1.0, size)
    axes = [even if np.any(np.abs(even - place) < 1e-9) else np.sort(np.append(even, place)) for place in at]
    count = len(axes[0])
    if count > MAX_SIZE or any(len(axis) != count for axis in axes):
        same = Cube(Lut(behind)(grid((even, even, even))), cube.interpolation)
        return curve, same, grid(node_levels(curve, same))
    places = np.linspace(0.0, 1.0, count)
    outputs = np.stack([np.interp(curve.outputs[:, c], axes[c], places) for c in range(3)], axis=1)
    values = Lut(behind)(grid((axes[0], axes[1], axes[2])))
    front, finer = Curve(outputs, curve.low, curve.high), Cube(values, cube.interpolation)
    return front, finer, grid(node_levels(front, finer))
