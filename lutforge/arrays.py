"""The kinds of arrays that functions take and return; a docstring says their shapes."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import ImageError

Array = NDArray[np.float64]
"""Numbers of fits and tables."""

Pixels = NDArray[np.float32]
"""Values of images."""

Codes = NDArray[np.uint8]
"""Values of images in 8 bits, as they are stored."""

Single = NDArray[np.float32]
"""Numbers of which there are too many for double precision."""

Real = NDArray[np.floating[Any]]
"""Numbers of either precision."""

Mask = NDArray[np.bool_]
"""Which elements are chosen."""

Index = NDArray[np.int64]
"""Places in another array."""

ColourFunction = Callable[[ArrayLike], Array]
"""Any function of colours (…, 3) → (…, 3), float64."""


def checked_colours(x: ArrayLike) -> Array:
    """Colours (…, 3) as float64.

    Raises ImageError on another shape, and on integers, whose scale is unknown: but not on lists of 0 and 1.
    """
    try:
        values = np.asarray(x)
    except ValueError as error:
        raise ImageError(f"colours have shape (…, 3), not rows of different lengths ({error})") from error
    plain = not isinstance(x, np.ndarray) and values.dtype.kind in "iu" and bool(np.all((values == 0) | (values == 1)))
    if values.dtype.kind != "f" and not plain and values.ndim > 0:
        raise ImageError(f"pixels of type {values.dtype}: scale them to [0, 1] first, such as pixels / 255.0")
    if values.ndim == 0 or values.shape[-1] != 3:
        raise ImageError(f"colours have shape (…, 3), not {values.shape}; pass pixels[..., :3] of an image with alpha")
    return np.asarray(values, dtype=np.float64)
