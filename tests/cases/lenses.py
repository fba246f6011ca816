"""How far a distortion that was found is from the one of the lens."""

import numpy as np

from lutforge.arrays import Array
from lutforge.shots.geometry import Distortion


def displacements(found: Distortion, true: Distortion, height: int, width: int) -> Array:
    """By how many RAW pixels (n, 2) two lenses place points of a picture (height, width) otherwise.

    Scale and offset of the picture do not count: a registration finds them besides.
    """
    y, x = np.meshgrid(np.linspace(0.1, 0.9, 7) * height, np.linspace(0.1, 0.9, 9) * width, indexing="ij")
    places = np.column_stack([x.ravel(), y.ravel()])
    first, second = (lens.distorted(places) - (lens.x, lens.y) for lens in (found, true))
    affine = np.column_stack([np.ones(len(places)), places])
    difference = first - second
    return np.asarray(difference - affine @ np.linalg.lstsq(affine, difference, rcond=None)[0])
