"""The steps of a transform in one sequence: what a process list (CLF, CTF) can hold whole.

A refinish between two lattices of a profile is lattice → matrix → lattice: written so, the file is the model, while one
cube of both can only come near. A refinish of a physical model becomes two cubes with the camera's clipping between.
"""

from collections.abc import Callable

import numpy as np

from lutforge.arrays import Array
from lutforge.errors import LutError
from lutforge.interpolation import Interpolation
from lutforge.luts.bake import bake, joined
from lutforge.luts.ops import Cube, Matrix, Op, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import FEW, shaper
from lutforge.model.gamut_map import GamutMap
from lutforge.model.highlights import NeutralHighlights
from lutforge.model.lattice import Lattice, grid, snap_levels, uniform_levels
from lutforge.model.transform import Clip, ColourFunction, Stage, Transform, through_stages

HIGHLIGHT_SIZE, DARK_CELLS = 33, 5
"""Nodes per axis of the cube that keeps white neutral, and how many cells of them lie below the light that is raised.
"""


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

    if isinstance(transform, Transform) and any(isinstance(stage, NeutralHighlights) for stage in transform.stages):
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
    RAW → JPEG. Only what is between them is computed anew, so that a picture with a white balance of its own costs
    milliseconds. Raises LutError on a transform that keeps no neutrals.
    """
    if transform.is_identity:
        return Lut((Range(),))
    linearize, between, highlights, render = grading_steps(transform)
    front = baked(linearize)
    cube = front.cube
    if cube is None:
        raise LutError(f"LUT: a cube is wanted, not {front.summary}")
    ahead, behind = front.ops[: front.ops.index(cube)], front.ops[front.ops.index(cube) :]
    values = through_stages(between, Lut(behind)(grid(uniform_levels(cube.size))))
    neutral = raised(highlights, np.ones(3), float((values / highlights.white).max()))
    return Lut((*ahead, Cube(values, cube.interpolation), *neutral, *baked(render).ops))


def raised(highlights: NeutralHighlights, gain: Array, reach: float, size: int = HIGHLIGHT_SIZE) -> tuple[Op, ...]:
    """Highlights as a cube of the light in front of a gain (3,), relative to white, up to `reach`.

    The nodes lie where light is raised, at the same levels in all channels. Interpolated in tetrahedra, what is not
    raised passes exactly, and so does the least channel. White is a node.
    """
    steps = len(highlights.floor) - 1
    dark = max(int(np.argmax(highlights.floor.max(axis=1) > 0)) - 1, DARK_CELLS) / steps
    below, above = np.linspace(0.0, dark, DARK_CELLS + 1)[:-1], np.linspace(dark, 1.0, size - 1 - DARK_CELLS)
    axis = snap_levels(np.append(np.append(below, above), max(reach, 1.0) + 0.01) / (max(reach, 1.0) + 0.01), FEW)
    levels, scale = (axis, axis, axis), highlights.white / gain / axis[-2]
    cube = Cube(highlights(grid(levels) * scale * gain), "tetrahedral")
    return Matrix(np.diag(1.0 / scale)), Range(), shaper(levels, FEW), cube


def grading_steps(transform: Transform) -> tuple[Transform, tuple[Stage, ...], NeutralHighlights, Transform]:
    """The parts of a refinish for photographs: JPEG → linear, from there to balanced light, highlights, and the render.

    Raises LutError on a transform that keeps no neutrals.
    """
    stages = transform.stages
    at = next((at for at, stage in enumerate(stages) if isinstance(stage, NeutralHighlights)), None)
    highlights = None if at is None else stages[at]
    if at is None or not isinstance(highlights, NeutralHighlights):
        raise LutError("LUT: photographs are graded by a refinish that keeps clipped neutrals")
    cut = 1 + next(at for at, stage in enumerate(stages) if isinstance(stage, Lattice | GamutMap))
    return Transform(stages[:cut]), stages[cut:at], highlights, Transform(stages[at + 1 :])
