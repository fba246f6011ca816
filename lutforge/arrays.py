"""The kinds of arrays that functions take and return; a docstring says their shapes."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
"""Numbers of fits and tables."""

Codes = NDArray[np.uint8]
"""Values of images in 8 bits, as they are stored."""

Single = NDArray[np.float32]
"""Values of images, and other numbers of which there are too many for double precision."""

Real = NDArray[np.floating[Any]]
"""Numbers of either precision."""

Mask = NDArray[np.bool_]
"""Which elements are chosen."""

Index = NDArray[np.int64]
"""Places in another array."""

ColourFunction = Callable[[ArrayLike], Array]
"""Any function of colours (…, 3) → (…, 3), float64."""
