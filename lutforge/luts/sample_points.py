"""Where two LUTs are compared: the same points every time, and more of them where a LUT bends."""

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.interpolation import Levels


def sample_points(levels: Levels, gain: NDArray[np.float64], count: int = 32768) -> NDArray[np.float64]:
    """Points (n, 3) in [0, 1], dense where a LUT bends.

    A Sobol sequence, the same squeezed towards the node levels, nodes and both sides of them, the grey axis,
    and the corners of the cube.

    levels, gain: of the LUT under test; `count` (a power of two) is the length of the sequence.
    """
    sequence = qmc.Sobol(3, scramble=False).random(count)
    axes = [np.clip(axis / g, 0.0, 1.0) for axis, g in zip(levels, gain, strict=True)]
    spread = np.stack([np.interp(sequence[:, c], np.linspace(0, 1, len(axes[c])), axes[c]) for c in range(3)], axis=1)
    nodes = np.stack([axes[c][(sequence[: count // 4, c] * len(axes[c])).astype(np.intp)] for c in range(3)], axis=1)
    step = 1.0 / 65535
    grey = np.repeat(np.linspace(0.0, 1.0, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    points: NDArray[np.float64] = np.clip(
        np.concatenate([sequence, spread, nodes, nodes + step, nodes - step, grey, corners]), 0.0, 1.0
    )
    return points
