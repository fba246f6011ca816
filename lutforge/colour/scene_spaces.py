"""The scene-linear spaces that a linearized image may be asked for in."""

from functools import cache
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

SceneSpace = Literal["raw", "linear-srgb", "acescg", "aces2065-1"]
SCENE_SPACES: tuple[SceneSpace, ...] = get_args(SceneSpace)


@cache
def from_linear_srgb(space: SceneSpace) -> NDArray[np.float64]:
    """(3, 3): linear sRGB (D65) → `space`, with Bradford adaptation to its white."""
    if space == "linear-srgb":
        return np.eye(3)
    import colour  # imported here: it takes a second, and most commands never need it

    target = {"acescg": "ACEScg", "aces2065-1": "ACES2065-1"}[space]
    spaces = colour.RGB_COLOURSPACES
    matrix = colour.matrix_RGB_to_RGB(spaces["sRGB"], spaces[target], chromatic_adaptation_transform="Bradford")
    return np.asarray(matrix, dtype=np.float64)
