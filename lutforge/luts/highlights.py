"""The cube that keeps white neutral: a picture's highlights, raised to grey where they come near to burnt-out white."""

from __future__ import annotations  # so that help() shows the names of types

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.ops import Cube, Matrix, Op, Range
from lutforge.luts.shaper import FEW, shaper
from lutforge.model.highlights import NeutralHighlights
from lutforge.model.lattice import grid, snap_levels, uniform_levels

HIGHLIGHT_SIZE, DARK_CELLS = 33, 2
"""Nodes per axis of the cube that keeps white neutral, and how many of its cells lie below the light that is raised."""


def raised(highlights: NeutralHighlights, gain: Array, reach: float, size: int = HIGHLIGHT_SIZE) -> tuple[Op, ...]:
    """Highlights as a cube of the light in front of a gain (3,), relative to white, up to `reach`.

    The nodes lie where light is raised. Interpolated in tetrahedra, what is not raised passes exactly. White is a node.
    """
    even = grid(uniform_levels(size)).reshape(-1, 3)
    moved = np.any(highlights(even * highlights.white) != even * highlights.white, axis=1)
    dark = max(float(even[moved].min(initial=1.0)), DARK_CELLS / size) - 1 / size
    below, above = np.linspace(0.0, dark, DARK_CELLS + 1)[:-1], np.linspace(dark, 1.0, size - 1 - DARK_CELLS)
    axis = snap_levels(np.append(np.append(below, above), max(reach, 1.0) + 0.01) / (max(reach, 1.0) + 0.01), FEW)
    levels, scale = (axis, axis, axis), highlights.white / gain / axis[-2]
    cube = Cube(highlights(grid(levels) * scale * gain), "tetrahedral")
    return Matrix(np.diag(1.0 / scale)), Range(), shaper(levels, FEW), cube
