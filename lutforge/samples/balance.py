"""Even coverage: at most so many tiles per colour, the flattest ones, so that a sky does not outweigh a
flower."""

import numpy as np
from numpy.typing import NDArray

BIN_CODES = 16
"""Side of a colour bin in JPEG codes: encoded values are roughly even to the eye."""
PER_BIN = 12
"""Tiles of one colour kept: enough to average their noise away."""
PER_BIN_RELAXED = 3
"""Tiles kept that met only a relaxed limit, in bins with fewer strict ones."""
PER_SHOT = 3000
"""Tiles of one shot kept."""


def balance(
    codes: NDArray[np.float64],
    level: NDArray[np.intp],
    roughness: NDArray[np.float64],
    per_shot: int = PER_SHOT,
) -> NDArray[np.intp]:
    """Indices, ascending, of the tiles to keep.

    codes: (n, 3) JPEG 0–255; level: (n,) 0 = strictly flat, higher = relaxed; roughness: (n,). In each colour
    bin the flattest are kept; relaxed ones only fill up bins that are nearly empty. The cap per bin is
    lowered until the shot keeps at most `per_shot`. Deterministic: ties go by position.
    """
    cells = np.clip(codes // BIN_CODES, 0, 255 // BIN_CODES).astype(np.intp)
    keys = (cells[:, 0] * 256 + cells[:, 1]) * 256 + cells[:, 2]
    order = np.lexsort((roughness, level, keys))
    ranked = keys[order]
    first = np.searchsorted(ranked, ranked, side="left")
    rank = np.arange(len(order)) - first
    candidates = (level[order] == 0) | (rank < PER_BIN_RELAXED)
    cap = PER_BIN
    while cap > 1 and np.count_nonzero(candidates & (rank < cap)) > per_shot:
        cap -= 1
    kept = order[candidates & (rank < cap)]
    if len(kept) > per_shot:
        kept = kept[np.lexsort((roughness[kept], level[kept]))[:per_shot]]
    return np.sort(kept)
