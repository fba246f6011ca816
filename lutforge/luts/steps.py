"""A refinish as its own steps in one sequence: what a process list (CLF, CTF) can hold whole.

A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while one
cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping between.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake, joined
from lutforge.luts.ops import Cube, Curve, Matrix, Op
from lutforge.luts.sequence import MAX_SIZE, Lut
from lutforge.luts.shaper import SHAPER_SIZE, node_levels
from lutforge.model.highlights import RAMP
from lutforge.model.lattice import grid
from lutforge.model.transform import Refinish, Transform

Array = NDArray[np.float64]


def bake_steps(
    transform: Transform,
    size: int | None = None,
    *,
    interpolation: Interpolation | None = None,
    title: str = "",
    comments: tuple[str, ...] = (),
) -> Lut:
    """Bake the steps of a transform apart: two cubes for a refinish or match, one for any other.

    The steps are those of the bare model: between them nothing tells what clipped, so white is not kept neutral.
    size: nodes per axis of each (33; lattices of a profile keep their own, and lose nothing).
    """
    if not isinstance(transform, Refinish):
        return bake(transform, size=size, interpolation=interpolation, title=title, comments=comments)
    first = bake(transform.linearize, size=size, interpolation=interpolation).ops
    last = bake(transform.render, size=size, interpolation=interpolation).ops
    if transform.transfer is None:
        return Lut(joined((*first, Matrix(transform.between), *last)), title, comments)
    cube, matrix = _cube_and_matrix(first)
    exposed = Cube(transform.exposed(cube.values @ matrix.T), cube.interpolation)
    return Lut(joined((*_in_front(first), exposed, *last)), title, comments)


def grading_lut(transform: Refinish, linearize: Lut, render: Lut) -> Lut:
    """A refinish for photographs, from the baked linearize and render of its two styles: what clipped stays neutral.

    linearize: JPEG → white-balanced RAW of the source's style; render: white-balanced RAW → JPEG. They serve all white
    balances; only the cube of the first is computed anew, so that a picture with a white balance of its own costs
    milliseconds. It gets one node more per axis, where a channel begins to count as clipped: below it colours are the
    model's.
    """
    front, cube = _with_node(linearize, 1.0 - RAMP)
    nodes = grid(node_levels(front, cube))
    matrix = getattr(transform.linearize, "matrix", np.eye(3))
    balanced = replace(transform, neutral_highlights=True).balanced(nodes, cube.values @ matrix.T)
    return Lut((front, Cube(balanced, cube.interpolation), *render.ops))


def _cube_and_matrix(ops: tuple[Op, ...]) -> tuple[Cube, Array]:
    """The cube of a linearize LUT, and the matrix behind it."""
    cube = next((op for op in ops if isinstance(op, Cube)), None)
    if cube is None:
        raise LutError("LUT: no cube to expose anew")
    return cube, ops[-1].matrix if isinstance(ops[-1], Matrix) else np.eye(3)


def _in_front(ops: tuple[Op, ...]) -> tuple[Op, ...]:
    at = next(number for number, op in enumerate(ops) if isinstance(op, Cube))
    return ops[:at]


def _with_node(lut: Lut, level: float) -> tuple[Curve, Cube]:
    """A shaper and cube with a node level more per axis, near `level`, where there is none and room for one."""
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
        return curve, Cube(Lut(behind)(grid((even, even, even))), cube.interpolation)
    places = np.linspace(0.0, 1.0, count)
    outputs = np.stack([np.interp(curve.outputs[:, c], axes[c], places) for c in range(3)], axis=1)
    values = Lut(behind)(grid((axes[0], axes[1], axes[2])))
    return Curve(outputs, curve.low, curve.high), Cube(values, cube.interpolation)
