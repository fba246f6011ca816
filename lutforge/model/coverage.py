"""Which colours a calibration covers: those that are neither clipped nor far from every sample."""

import numpy as np
import scipy
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.model.gamut_map import GamutMap
from lutforge.model.lattice import Lattice, grid
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.samples.clipping import HALF_CODE, clipped

FARTHEST = 24.0 / 255.0
"""Default limit: distance to the nearest sample, in encoded RGB."""


def uncovered(style: PictureStyle, encoded: ArrayLike, farthest: float = FARTHEST) -> Mask:
    """Return the mask (…,) of encoded colours (…, 3) farther than `farthest` from every sample.

    The samples are taken to be at the centres of the camera models, or at the nodes of a lattice that samples touched.
    A style that has neither covers no colour.
    """
    return ~np.isfinite(_distance(style, np.asarray(encoded, dtype=np.float64), farthest))


def _distance(style: PictureStyle, encoded: Array, most: float) -> Array:
    """The distance (…,) of encoded colours (…, 3) to the style's nearest sample, infinite beyond `most`."""
    parts = [_centres(model) for model in style.models]
    if not parts and style.linearize is not None and "linearize" in style.coverage:
        touched = np.nonzero(style.coverage["linearize"] > 0)
        parts.append(np.stack([axis[at] for axis, at in zip(style.linearize.levels, touched, strict=True)], axis=1))
    if not sum(map(len, parts)):
        return np.full(encoded.shape[:-1], np.inf)
    tree = scipy.spatial.cKDTree(np.concatenate(parts))
    distance = tree.query(encoded.reshape(-1, 3), distance_upper_bound=most, workers=-1)[0]
    return np.asarray(distance.reshape(encoded.shape[:-1]))


def _centres(model: CameraModel) -> Array:
    """The codes (n, 3) of the centres of a model: of its fitted inverse, or of its rendering where that is solved."""
    inverse = model.inverse_gamut_map
    mapped = inverse.centres if isinstance(inverse, GamutMap) else model.gamut_map(model.gamut_map.centres)
    return model.response.encode(mapped)


_AXIS = np.concatenate([[0.0, HALF_CODE], np.linspace(2 * HALF_CODE, 1.0 - 2 * HALF_CODE, 29), [1.0 - HALF_CODE, 1.0]])
"""Node levels of a lattice of confidences: clipped codes have a layer of their own."""


def confidence(style: PictureStyle) -> Lattice:
    """Return a lattice over encoded colours whose values are (confidence, unclipped, covered), each from 0 to 1.

    covered: by the distance to the nearest sample: 1 up to half the limit of `uncovered`, then falling linearly to 0 at
    one and a half times the limit. unclipped: 0 where a channel is at 0 or 255, else 1. confidence: the smaller of
    these two. The lattice takes O(N³ log n) time; an image is then evaluated at the speed of a LUT.
    """
    nodes = grid((_AXIS, _AXIS, _AXIS))
    covered = np.clip(1.5 - _distance(style, nodes, 1.5 * FARTHEST) / FARTHEST, 0.0, 1.0)
    unclipped = np.where(clipped(nodes), 0.0, 1.0)
    values = np.stack([np.minimum(covered, unclipped), unclipped, covered], axis=-1)
    return Lattice((_AXIS, _AXIS, _AXIS), values)
