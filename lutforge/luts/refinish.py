"""The LUT of a refinish for photographs, from the baked steps of its two styles: white stays neutral."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.errors import LutError
from lutforge.luts.highlight_ops import highlight_ops
from lutforge.luts.ops import Cube, Range
from lutforge.luts.sequence import Lut
from lutforge.model.gamut_map import GamutMap
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice, grid, uniform_levels
from lutforge.model.neutral_highlights import NeutralHighlights
from lutforge.model.transform import Stage, Transform, through_stages


@dataclass(frozen=True, eq=False)
class RefinishSteps:
    """The steps of a refinish.

    linearize: JPEG → linear; between: linear → white-balanced RAW; highlights: keeps highlights neutral there;
    render: white-balanced RAW → JPEG. linearize and render are the same under all white balances.
    """

    linearize: Transform
    between: tuple[Stage, ...]
    highlights: NeutralHighlights
    render: Transform


def keeps_neutrals(transform: Transform) -> bool:
    """True for a refinish that keeps clipped neutrals neutral."""
    return any(isinstance(stage, NeutralHighlights) for stage in transform.stages)


def steps_of(transform: Transform) -> RefinishSteps:
    """Return the steps of a refinish. Raises LutError on a transform that keeps no neutrals."""
    stages = transform.stages
    index = next((index for index, stage in enumerate(stages) if isinstance(stage, NeutralHighlights)), None)
    highlights = None if index is None else stages[index]
    if index is None or not isinstance(highlights, NeutralHighlights):
        raise LutError("LUT: photographs are graded by a refinish that keeps clipped neutrals")
    models = (at for at, stage in enumerate(stages) if isinstance(stage, Lattice | GamutMap | SolvedInverse))
    cut = 1 + next(models)
    return RefinishSteps(Transform(stages[:cut]), stages[cut:index], highlights, Transform(stages[index + 1 :]))


def refinish_lut(transform: Transform, baked: Callable[[Transform], Lut]) -> Lut:
    """Return the LUT of a refinish.

    baked: returns the LUT of linearize or of render, which are the same under all white balances. Only the stages
    between these two are computed anew, so that a picture with another white balance costs milliseconds. Raises
    LutError on a transform that keeps no neutrals.
    """
    if transform.is_identity:
        return Lut((Range(),))
    steps = steps_of(transform)

    linearize = baked(steps.linearize)
    cube = linearize.cube
    if cube is None:
        raise LutError(f"LUT: a cube is needed, not {linearize.summary}")
    index = linearize.ops.index(cube)

    # The cube also holds the stages between, which are linear.
    from_cube = Lut(linearize.ops[index:])
    values = through_stages(steps.between, from_cube(grid(uniform_levels(cube.size))))
    neutral = highlight_ops(steps.highlights, np.ones(3), float((values / steps.highlights.white).max()))
    return Lut((*linearize.ops[:index], Cube(values, cube.interpolation), *neutral, *baked(steps.render).ops))
