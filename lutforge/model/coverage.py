"""Which colours a calibration covers: those that are neither clipped nor far from every sample."""

from collections.abc import Callable

import numpy as np
import scipy
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.interpolation import interpolate
from lutforge.model.highlights import CLIPPED, clipped
from lutforge.model.lattice import Lattice, grid
from lutforge.model.profile_data import PictureStyle

FARTHEST = 24.0 / 255.0
"""Default limit: distance to the nearest sample, in encoded RGB."""
WORST = 0.1
"""An expected error, the norm of encoded RGB, that is not trusted at all; 25 codes."""


def uncovered(style: PictureStyle, encoded: ArrayLike, farthest: float = FARTHEST) -> Mask:
    """Return the mask (…,) of encoded colours (…, 3) farther than `farthest` from every sample.

    The samples are taken to be at the centres of h⁻¹, or at the nodes of a lattice that samples touched. Of a style
    that has neither, no colour is covered.
    """
    return ~np.isfinite(_distance(style, np.asarray(encoded, dtype=np.float64), farthest))


def _distance(style: PictureStyle, encoded: Array, most: float) -> Array:
    """The distance (…,) of encoded colours (…, 3) to the style's nearest sample, infinite beyond `most`."""
    parts = [model.response.encode(model.inverse_gamut_map.centres) for model in style.physical]
    if not parts and style.linearize is not None and "linearize" in style.coverage:
        touched = np.nonzero(style.coverage["linearize"] > 0)
        parts.append(np.stack([axis[at] for axis, at in zip(style.linearize.levels, touched, strict=True)], axis=1))
    if not sum(map(len, parts)):
        return np.full(encoded.shape[:-1], np.inf)
    tree = scipy.spatial.cKDTree(np.concatenate(parts))
    distance = tree.query(encoded.reshape(-1, 3), distance_upper_bound=most, workers=-1)[0]
    return np.asarray(distance.reshape(encoded.shape[:-1]))


_AXIS = np.concatenate([[0.0, CLIPPED], np.linspace(2 * CLIPPED, 1.0 - 2 * CLIPPED, 29), [1.0 - CLIPPED, 1.0]])
"""Node levels of a lattice of confidences: clipped codes have a layer of their own."""


def confidence(style: PictureStyle) -> Lattice:
    """Return a lattice over encoded colours whose values are (confidence, unclipped, covered), each from 0 to 1.

    covered: by the distance to the nearest sample: 1 up to half the limit of `uncovered`, then falling linearly to 0 at
    one and a half times the limit. unclipped: 0 where a channel is at 0 or 255, else 1. confidence: the smaller of
    both. The lattice takes O(N³ log n) time; an image is then evaluated at the speed of a LUT.
    """
    nodes = grid((_AXIS, _AXIS, _AXIS))
    return _unclipped(nodes, np.clip(1.5 - _distance(style, nodes, 1.5 * FARTHEST) / FARTHEST, 0.0, 1.0))


def refinish_confidence(
    style: PictureStyle, target: PictureStyle, graded: Callable[[Array], Array], balanced: Callable[[Array], Array]
) -> Lattice:
    """Return such a lattice for a refinish: covered is 1 − e / WORST where both styles know their expected error e.

    Where they do not, it is that of `confidence`. graded: takes encoded colours (…, 3) to refinished ones; balanced:
    takes them to Tw E of `target`, which renders them anew.
    """
    if "linearize" not in style.expected or "render" not in target.expected:
        return confidence(style)
    # Three independent errors, norms of encoded RGB, add up in the square: one code of noise in each channel and the
    # error of linearizing, both multiplied by the gain of the refinish there, and the error of rendering.
    nodes = grid((_AXIS, _AXIS, _AXIS))
    changed = graded(nodes)
    slopes = np.stack([np.gradient(changed, _AXIS, axis=axis) for axis in range(3)], axis=-1)
    gain = np.sqrt(np.sum(slopes**2, axis=(-2, -1)))
    linearized = _interpolated(style.linearize, style.expected["linearize"], nodes)
    rendered = _interpolated(target.render, target.expected["render"], balanced(nodes))
    error = np.sqrt((gain * 2 * CLIPPED) ** 2 + (gain * linearized) ** 2 / 3.0 + rendered**2)
    return _unclipped(nodes, np.clip(1.0 - error / WORST, 0.0, 1.0))


def _unclipped(nodes: Array, covered: Array) -> Lattice:
    """The lattice of confidences (N, N, N) at nodes (N, N, N, 3)."""
    unclipped = np.where(clipped(nodes), 0.0, 1.0)
    values = np.stack([np.minimum(covered, unclipped), unclipped, covered], axis=-1)
    return Lattice((_AXIS, _AXIS, _AXIS), values)


def linearizing_error(style: PictureStyle) -> Callable[[Array], Array] | None:
    """Return the expected error (…,) of linearizing as a function of encoded colours (…, 3), None if unknown."""
    if "linearize" not in style.expected:
        return None
    return lambda encoded: _interpolated(style.linearize, style.expected["linearize"], encoded)


def _interpolated(lattice: Lattice | None, expected: Array, at: Array) -> Array:
    """Interpolate the expected errors of a lattice's nodes at colours (…, 3), (…,)."""
    assert lattice is not None  # or the style would hold no expected errors
    return interpolate(at, lattice.levels, np.repeat(expected[..., None], 3, axis=-1), "trilinear")[..., 0]
