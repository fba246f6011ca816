"""Even coverage: at most so many tiles per colour, the flattest ones, so that a sky does not outweigh a
flower."""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array


def balance(
    codes: Array,
    level: NDArray[np.intp],
    roughness: Array,
    per_shot: int = 3000,
    per_bin: int = 12,
    per_bin_relaxed: int = 3,
) -> NDArray[np.intp]:
    """Indices, ascending, of the tiles to keep.

    codes: (n, 3) JPEG 0–255; level: (n,) 0 = strictly flat, higher = relaxed; roughness: (n,). In each colour
    bin of 16 codes a side, in which encoded values are roughly even to the eye, the `per_bin` flattest are kept:
    enough to average their noise away. Relaxed ones only fill up bins of fewer than `per_bin_relaxed`. The cap per bin
    is lowered until the shot keeps at most `per_shot`. Deterministic: ties go by position.
    """
    cells = np.clip(codes // 16, 0, 15).astype(np.intp)
    keys = (cells[:, 0] * 256 + cells[:, 1]) * 256 + cells[:, 2]
    order = np.lexsort((roughness, level, keys))
    ranked = keys[order]
    first = np.searchsorted(ranked, ranked, side="left")
    rank = np.arange(len(order)) - first
    candidates = (level[order] == 0) | (rank < per_bin_relaxed)
    cap = per_bin
    while cap > 1 and np.count_nonzero(candidates & (rank < cap)) > per_shot:
        cap -= 1
    kept = order[candidates & (rank < cap)]
    if len(kept) > per_shot:
        kept = kept[np.lexsort((roughness[kept], level[kept]))[:per_shot]]
    return np.sort(kept)
