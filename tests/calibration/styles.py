"""Styles of samples that tests make of arrays."""

import numpy as np
from numpy.typing import NDArray

from lutforge.calibration.style import StyleData
from lutforge.samples.sample_set import SampleSet

Array = NDArray[np.float64]


def style_of(x: Array, y: Array, shots: int = 10) -> StyleData:
    """A style of samples Tw E → I, each (n, 3), dealt out to some shots."""
    shot = np.array([f"shot {row % shots}" for row in range(len(x))])
    return StyleData(x, y, shot, SampleSet.from_arrays(x, y, camera="camera", shot=shot, wb=1.0))
