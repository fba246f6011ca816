"""The cube that keeps white neutral: highlights become grey where they come near to clipped white."""

from __future__ import annotations  # so that help() shows the names of types

import numpy as np

from lutforge.arrays import Array
from lutforge.luts.ops import Cube, Matrix, Op, Range
from lutforge.luts.shaper import shaper
from lutforge.model.lattice import SHORT_SHAPER_SIZE, grid, snap_levels, uniform_levels
from lutforge.model.neutral_highlights import NeutralHighlights

HIGHLIGHT_SIZE = 33
"""Nodes per axis of the cube that keeps white neutral."""

DARK_CELLS = 2
"""Cells per axis below the linear values that it changes."""


def highlight_ops(
    highlights: NeutralHighlights, gain: Array, reach: float, size: int = HIGHLIGHT_SIZE
) -> tuple[Op, ...]:
    """Highlights as a cube of the linear values before a gain (3,), relative to white, up to `reach`.

    The nodes lie where values are changed, and white is a node. Values that are not changed pass exactly, since the
    cube is interpolated in tetrahedra.
    """
    even = grid(uniform_levels(size)).reshape(-1, 3)
    changed = np.any(highlights(even * highlights.white) != even * highlights.white, axis=1)
    dark = max(float(even[changed].min(initial=1.0)), DARK_CELLS / size) - 1 / size

    below = np.linspace(0.0, dark, DARK_CELLS + 1)[:-1]
    above = np.linspace(dark, 1.0, size - 1 - DARK_CELLS)
    highest = max(reach, 1.0) + 0.01
    axis = snap_levels(np.append(np.append(below, above), highest) / highest, SHORT_SHAPER_SIZE)

    levels = (axis, axis, axis)
    scale = highlights.white / gain / axis[-2]
    cube = Cube(highlights(grid(levels) * scale * gain), "tetrahedral")
    return Matrix(np.diag(1.0 / scale)), Range(), shaper(levels, SHORT_SHAPER_SIZE), cube
