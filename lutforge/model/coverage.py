"""Which colours a calibration covers: those that are neither clipped nor far from every sample."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask
from lutforge.interpolation import Levels, interpolate
from lutforge.model.highlights import CLIPPED, clipped
from lutforge.model.lattice import Lattice, grid
from lutforge.model.profile_data import PhysicalModel, PictureStyle

FARTHEST = 24.0 / 255.0
"""Default limit: distance to the nearest sample, in encoded RGB."""
WORST = 0.1
"""An expected error, the norm of encoded RGB, that is not trusted at all; 25 codes."""


def uncovered(style: PictureStyle, encoded: ArrayLike, farthest: float = FARTHEST) -> Mask:
    """Return the mask (…,) of encoded colours (…, 3) farther than `farthest` from every sample: they are guessed.

    Samples are the centres of h⁻¹, or of a lattice the nodes that samples touched. A style with neither knows nothing.
    """
    values = np.asarray(encoded, dtype=np.float64)
    points = _sampled(style)
    if len(points) == 0:
        return np.ones(values.shape[:-1], dtype=np.bool_)
    distance, _ = scipy.spatial.cKDTree(points).query(values.reshape(-1, 3), distance_upper_bound=farthest, workers=-1)
    mask: Mask = ~np.isfinite(distance).reshape(values.shape[:-1])
    return mask


@dataclass(frozen=True)
class Refinish:
    """What is done to encoded colours (…, 3). graded: → encoded; balanced: → Tw E of the style that renders them."""

    graded: Callable[[Array], Array]
    balanced: Callable[[Array], Array]
    style: PictureStyle


def confidence(style: PictureStyle, refinish: Refinish | None = None, size: int = 33) -> Lattice:
    """A lattice of encoded colours with how well they are known: (confidence, unclipped, covered), each 0 to 1.

    covered: 1 − e / WORST of the error e to expect where both styles know it; else 1 as near to a sample as half the
    limit of `uncovered`, falling evenly to 0 at one and a half of it: 0.5 is the limit. unclipped: 0 where a channel is
    at 0 or 255. confidence: the smaller. O(size³ log n) once; then any image at the speed of a LUT.
    """
    axis = np.linspace(2 * CLIPPED, 1.0 - 2 * CLIPPED, size - 4)
    axis = np.concatenate([[0.0, CLIPPED], axis, [1.0 - CLIPPED, 1.0]])
    levels = (axis, axis.copy(), axis.copy())
    nodes = grid(levels)
    if refinish is not None and "linearize" in style.expected and "render" in refinish.style.expected:
        trust = np.clip(1.0 - _expected_error(style, refinish, levels) / WORST, 0.0, 1.0)
    else:
        trust = _nearness(style, nodes)
    unclipped = np.where(clipped(nodes), 0.0, 1.0)
    return Lattice(levels, np.stack([np.minimum(trust, unclipped), unclipped, trust], axis=-1))


def _nearness(style: PictureStyle, nodes: Array) -> Array:
    points = _sampled(style)
    if len(points) == 0:
        return np.zeros(nodes.shape[:3])
    tree = scipy.spatial.cKDTree(points)
    reach = tree.query(nodes.reshape(-1, 3), distance_upper_bound=1.5 * FARTHEST, workers=-1)[0]
    return np.asarray(np.clip(1.5 - reach / FARTHEST, 0.0, 1.0).reshape(nodes.shape[:3]))


def _expected_error(style: PictureStyle, refinish: Refinish, levels: Levels) -> Array:
    """The norm of the error to expect of what encoded colours at nodes are refinished to, (N_r, N_g, N_b).

    Independent are a code of noise in each channel, the error of linearizing, which both count as often as the refinish
    multiplies them there, and that of rendering.
    """
    nodes = grid(levels)
    graded = refinish.graded(nodes)
    slopes = np.stack([np.gradient(graded, level, axis=axis) for axis, level in enumerate(levels)], axis=-1)
    gain = np.sqrt(np.sum(slopes**2, axis=(-2, -1)))
    linearized = _told(style.linearize, style.expected["linearize"], nodes)
    rendered = _told(refinish.style.render, refinish.style.expected["render"], refinish.balanced(nodes))
    return np.asarray(np.sqrt((gain * 2 * CLIPPED) ** 2 + (gain * linearized) ** 2 / 3.0 + rendered**2))


def linearizing_error(style: PictureStyle) -> Callable[[Array], Array] | None:
    """What takes encoded colours (…, 3) to the error to expect of linearizing them (…,); None where it is not known."""
    if "linearize" not in style.expected:
        return None
    return lambda encoded: _told(style.linearize, style.expected["linearize"], encoded)


def _told(lattice: Lattice | None, expected: Array, at: Array) -> Array:
    """What a lattice's nodes expect, at colours (…, 3) → (…,)."""
    assert lattice is not None  # or the style would hold no expected errors
    return interpolate(at, lattice.levels, np.repeat(expected[..., None], 3, axis=-1), "trilinear")[..., 0]


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
