"""Where a LUT is compared with its model: the same points every time, and more of them where it bends."""

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.luts.ops import Matrix
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import node_levels


def sample_points(lut: Lut, count: int = 32768) -> Array:
    """Points (n, 3) of a LUT's domain, dense where it bends.

    A Sobol sequence, the same squeezed towards the node levels, nodes and both sides of them, the grey axis, and the
    corners of the cube; behind a matrix of a scene-linear space also what is beyond the domain. `count` (a power of
    two) is the length of the sequence.
    """
    first = lut.ops[0]
    matrix = first if isinstance(first, Matrix) else Matrix(np.eye(3))
    low, high = (0.0, 1.0) if lut.shaper is None else (lut.shaper.low, lut.shaper.high)
    axes = (np.linspace(low, high, 33),) * 3 if lut.cube is None else node_levels(lut.shaper, lut.cube)
    sequence = scipy.stats.qmc.Sobol(3, scramble=False).random(count)
    spread = np.stack([np.interp(sequence[:, c], np.linspace(0, 1, len(axes[c])), axes[c]) for c in range(3)], axis=1)
    nodes = np.stack([axes[c][(sequence[: count // 4, c] * len(axes[c])).astype(np.intp)] for c in range(3)], axis=1)
    step = (high - low) / 65535
    bends = np.clip(np.concatenate([spread, nodes, nodes + step, nodes - step]), low, high)
    grey = np.repeat(np.linspace(0.0, 1.0, 1025)[:, None], 3, axis=1)
    corners = np.array(np.meshgrid([0.0, 1.0], [0.0, 1.0], [0.0, 1.0])).reshape(3, -1).T
    even = np.concatenate([sequence, grey, corners])
    back = np.linalg.inv(matrix.matrix)
    if not matrix.is_diagonal:
        x = (np.concatenate([low + even * (high - low), bends]) - matrix.offset) @ back.T
        return np.concatenate([x, 2 * x[::8]])  # and what the camera clips
    reach = np.maximum((high - matrix.offset) * np.diag(back), 1.0)
    return np.concatenate([even * reach, (bends - matrix.offset) * np.diag(back)])
