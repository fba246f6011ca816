"""What clipped in the source cannot be recovered; it is kept neutral, not turned into a colour by new multipliers."""

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Mask

CLIPPED = 0.5 / 255.0
"""An encoded channel this near to 0 or 1 is clipped: half a code of an 8-bit file."""

RAMP = 8.0 / 255.0
"""Encoded values this near to 1 begin to count as clipped: a cell of a cube of 33³."""


def clipped(encoded: ArrayLike) -> Mask:
    """(…,) of encoded (…, 3): a channel at 0 or 255, whose RAW value cannot be told."""
    values = np.asarray(encoded, dtype=np.float64)
    mask: Mask = np.any((values <= CLIPPED) | (values >= 1.0 - CLIPPED), axis=-1)
    return mask


def neutral_where_clipped(encoded: Array, balanced: Array, to_linear: Array | None = None) -> Array:
    """Balanced linear colours (…, 3) to render anew, with what clipped in the source `encoded` (…, 3) kept neutral.

    The true value of a channel at 255 is at least what it reads: it is raised to the smallest of the unclipped ones,
    which makes burnt-out neutrals neutral and leaves saturated colours alone. Where all are at 255 they are raised to
    the largest, where all are at 0 lowered to the smallest. It sets in over the last RAMP below 1, as a lookup table
    cannot jump; other colours are untouched.

    to_linear: (3, 3), rows sum to 1, to the linear light of the output: as much white is added as keeps each of its
    channels from becoming darker, where a tinted grey becomes a neutral white.
    """
    burnt = np.clip((encoded - (1.0 - RAMP)) / RAMP, 0.0, 1.0)
    if not burnt.any() and np.all(encoded > CLIPPED):
        return balanced
    highest = balanced.max(axis=-1, keepdims=True)
    floor = (balanced + burnt * (highest - balanced)).min(axis=-1, keepdims=True)
    raised = balanced + burnt * np.maximum(floor - balanced, 0.0)
    if to_linear is not None:
        raised += np.maximum(((balanced - raised) @ to_linear.T).max(axis=-1, keepdims=True), 0.0)
    black = np.all(encoded <= CLIPPED, axis=-1, keepdims=True)
    return np.asarray(np.where(black, balanced.min(axis=-1, keepdims=True), raised))
