"""Orientations of stored pictures, by the numbers of the tag Orientation, 1 … 8 (TIFF 6.0; Exif 2.32, 4.6.4 A)."""

from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array

Kind = TypeVar("Kind", bound=np.generic)
"""Numbers of an image, of any type."""

ORIENTATION_OF_FLIP = {0: 1, 1: 2, 2: 4, 3: 3, 4: 5, 5: 8, 6: 6, 7: 7, 90: 6, 180: 3, 270: 8}
"""LibRaw's flip → Orientation. Its bits mirror rows, mirror columns and swap the two; some decoders give degrees."""

MIRRORED = frozenset({2, 4, 5, 7})

QUARTER_TURNS = {1: 0, 2: 0, 3: 2, 4: 2, 5: 1, 6: 3, 7: 3, 8: 1}
"""Orientation → quarter turns (numpy.rot90) that follow the mirroring."""


def upright(array: NDArray[Kind], orientation: int) -> NDArray[Kind]:
    """Turn a stored image (h, w, …) upright by its orientation; a number outside 1 … 8 turns nothing."""
    mirrored = array[:, ::-1] if orientation in MIRRORED else array
    return np.ascontiguousarray(np.rot90(mirrored, QUARTER_TURNS.get(orientation, 0)))


def inverse(orientation: int) -> int:
    """Return the orientation that turns an upright image back to the stored one."""
    return {6: 8, 8: 6}.get(orientation, orientation)


def orientation_between(stored: NDArray[Kind], shown: NDArray[Kind]) -> int | None:
    """The orientation that turns `stored` into exactly `shown`; None where they are different pictures."""
    return next((number for number in QUARTER_TURNS if np.array_equal(upright(stored, number), shown)), None)


def upright_places(places: Array, orientation: int) -> Array:
    """The places in the upright image of places (n, 2) in a stored one: x, y as shares of its width and height."""
    x, y = places[:, 0], places[:, 1]
    if orientation in MIRRORED:
        x = 1.0 - x
    for _ in range(QUARTER_TURNS.get(orientation, 0)):
        x, y = y, 1.0 - x
    return np.column_stack([x, y])
