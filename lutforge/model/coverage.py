"""Which colours a calibrated camera really knows: neither clipped nor far from every sample."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from lutforge.model.camera_profile import PhysicalModel, PictureStyle
from lutforge.model.lattice import Lattice

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FARTHEST = 24.0 / 255.0
"""Default limit: distance to the nearest sample, in encoded RGB."""
CLIPPED = 0.5 / 255.0


def clipped(encoded: ArrayLike) -> Mask:
    """(…,) of encoded (…, 3): a channel at 0 or 255, whose RAW value cannot be told."""
    values = np.asarray(encoded, dtype=np.float64)
    mask: Mask = np.any((values <= CLIPPED) | (values >= 1.0 - CLIPPED), axis=-1)
    return mask


def uncovered(style: PictureStyle, encoded: ArrayLike, farthest: float = FARTHEST) -> Mask:
    """(…,) of encoded (…, 3): colours farther than `farthest` from every sample of the style; linearizing them guesses.

    Samples are the centres of h⁻¹, or of a lattice the nodes that samples touched. A style with neither knows nothing.
    """
    values = np.asarray(encoded, dtype=np.float64)
    points = _sampled(style)
    if len(points) == 0:
        return np.ones(values.shape[:-1], dtype=np.bool_)
    distance, _ = cKDTree(points).query(values.reshape(-1, 3), distance_upper_bound=farthest, workers=-1)
    mask: Mask = ~np.isfinite(distance).reshape(values.shape[:-1])
    return mask


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
