"""Which colours a calibrated camera really knows: neither clipped nor far from every sample."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.model.highlights import CLIPPED, clipped
from lutforge.model.lattice import Lattice, grid
from lutforge.model.profile_data import PhysicalModel, PictureStyle

FARTHEST = 24.0 / 255.0
"""Default limit: distance to the nearest sample, in encoded RGB."""


def uncovered(style: PictureStyle, encoded: ArrayLike, farthest: float = FARTHEST) -> Mask:
    """(…,) of encoded (…, 3): colours farther than `farthest` from every sample of the style; linearizing them guesses.

    Samples are the centres of h⁻¹, or of a lattice the nodes that samples touched. A style with neither knows nothing.
    """
    values = np.asarray(encoded, dtype=np.float64)
    points = _sampled(style)
    if len(points) == 0:
        return np.ones(values.shape[:-1], dtype=np.bool_)
    distance, _ = scipy.spatial.cKDTree(points).query(values.reshape(-1, 3), distance_upper_bound=farthest, workers=-1)
    mask: Mask = ~np.isfinite(distance).reshape(values.shape[:-1])
    return mask


def confidence(style: PictureStyle, size: int = 33) -> Lattice:
    """A lattice of encoded colours with how well the style knows them: (confidence, unclipped, covered), each 0 to 1.

    covered: 1 as near to a sample as half the limit of `uncovered`, falling evenly to 0 at one and a half of it: 0.5 is
    the limit. unclipped: 0 where a channel is at 0 or 255. confidence: the smaller. O(size³ log n) once; then any image
    at the speed of a LUT.
    """
    axis = np.linspace(2 * CLIPPED, 1.0 - 2 * CLIPPED, size - 4)
    axis = np.concatenate([[0.0, CLIPPED], axis, [1.0 - CLIPPED, 1.0]])
    levels = (axis, axis.copy(), axis.copy())
    nodes = grid(levels)
    points = _sampled(style)
    trust = np.zeros(nodes.shape[:3])
    if len(points):
        reach = scipy.spatial.cKDTree(points).query(
            nodes.reshape(-1, 3), distance_upper_bound=1.5 * FARTHEST, workers=-1
        )[0]
        trust = np.clip(1.5 - reach / FARTHEST, 0.0, 1.0).reshape(trust.shape)
    unclipped = np.where(clipped(nodes), 0.0, 1.0)
    return Lattice(levels, np.stack([np.minimum(trust, unclipped), unclipped, trust], axis=-1))


def _sampled(style: PictureStyle) -> Array:
    """Encoded colours (n, 3) that the style has samples at."""
    parts = [_centres(model) for model in style.physical]
    if not parts and style.linearize is not None and "linearize" in style.coverage:
        parts.append(_touched(style.linearize, style.coverage["linearize"]))
    return np.concatenate(parts) if parts else np.zeros((0, 3))


def _centres(model: PhysicalModel) -> Array:
    return model.response.encode(model.inverse_gamut_map.centres)


def _touched(lattice: Lattice, coverage: Array) -> Array:
    r, g, b = np.nonzero(coverage > 0)
    levels = lattice.levels
    return np.stack([levels[0][r], levels[1][g], levels[2][b]], axis=1)
