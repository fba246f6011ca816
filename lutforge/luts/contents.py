"""What is in a LUT file, ours or not."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Curve:
    """A 1D table: outputs (m, channels) at inputs (m, channels), or at m even steps of a domain."""

    outputs: Array
    inputs: Array | None = None
    domain: tuple[float, float] = (0.0, 1.0)


@dataclass(frozen=True, eq=False)
class LutContents:
    """A LUT file as it was read. format: its name; dialect: which kind of it.

    cube: (N_r, N_g, N_b, 3); shaper: the 1D table before the cube, or the only one; response: one behind it; domain:
    lowest and highest input of each channel; keywords: the header words that readers stumble over; stages: of a process
    list, in order; bits: of integer files.
    """

    format: str
    dialect: str = ""
    title: str = ""
    comments: tuple[str, ...] = ()
    cube: Array | None = None
    shaper: Curve | None = None
    response: Curve | None = None
    domain: tuple[tuple[float, float, float], tuple[float, float, float]] = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    keywords: frozenset[str] = frozenset()
    stages: tuple[str, ...] = field(default=())
    bits: int | None = None
