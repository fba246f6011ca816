"""Node levels of a linearization, with a layer of their own for clipped codes, and which nodes neutrals run through."""

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Levels
from lutforge.model.lattice import uniform_levels
from lutforge.model.node_levels import snap_levels
from lutforge.ocio.lut_files import CURVE_SIZE
from lutforge.ocio.made_colours import MadeColours

LAYER = 8
"""Entry of the shaper at which the second level stands, within half an 8-bit code of the first; likewise at the end."""


def even_levels(colours: MadeColours, size: int) -> Levels:
    """Node levels of the JPEG, most of them evenly spread on it, the rest on the axes of the lattice."""
    even = np.linspace(0.0, 1.0, size)
    bent = colours.encoded(uniform_levels(size))
    r, g, b = (0.75 * even + 0.25 * axis for axis in bent)
    return (r, g, b)


def layered(levels: Levels) -> Levels:
    """Snapped to the shaper, with two levels more: next to the first and next to the last."""
    step = LAYER / (CURVE_SIZE - 1)
    r, g, b = (
        np.concatenate([[0.0, step], np.clip(axis[1:-1], 1.5 * step, 1 - 1.5 * step), [1 - step, 1.0]])
        for axis in levels
    )
    return (snap_levels(r, CURVE_SIZE), snap_levels(g, CURVE_SIZE), snap_levels(b, CURVE_SIZE))


def unlayered(levels: Levels) -> Levels:
    """Without these two."""
    r, g, b = (np.delete(axis, [1, -2]) for axis in levels)
    return (r, g, b)


def neutral_nodes(levels: Levels) -> NDArray[np.bool_]:
    """The nodes of all cells that neutrals run through, black to white, (N, N, N)."""
    grey = np.linspace(0.0, 1.0, 4 * CURVE_SIZE)
    r, g, b = (np.clip(np.searchsorted(axis, grey, side="right") - 1, 0, len(axis) - 2) for axis in levels)
    there = np.zeros(tuple(len(axis) for axis in levels), dtype=np.bool_)
    for corner in range(8):
        there[r + (corner >> 2), g + ((corner >> 1) & 1), b + (corner & 1)] = True
    return there
