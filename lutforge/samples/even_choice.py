"""Even coverage: at most so many tiles per colour, flat ones from all parts of the picture.

So a sky does not outweigh a flower, nor the middle the corners, where a lens gives less light.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array


def choose_evenly(
    codes: Array,
    places: Array,
    level: NDArray[np.intp],
    roughness: Array,
    per_shot: int = 3000,
    per_bin: int = 12,
    per_bin_relaxed: int = 3,
) -> NDArray[np.intp]:
    """Indices, ascending, of the tiles to keep.

    codes: (n, 3) JPEG 0–255; places: (n, 2) in the picture, −1 … 1; level: (n,) 0 = strictly flat, higher = relaxed;
    roughness: (n,). In each colour bin of 16 codes a side, in which encoded values are roughly even to the eye,
    `per_bin` are kept: enough to average their noise away. They are the flattest of each part of the picture in turn,
    of six by six parts. Relaxed ones only fill up bins of fewer than `per_bin_relaxed`. The cap per bin is lowered
    until the shot keeps at most `per_shot`. Deterministic: ties go by position.
    """
    cells = np.clip(codes // 16, 0, 15).astype(np.intp)
    keys = (cells[:, 0] * 256 + cells[:, 1]) * 256 + cells[:, 2]
    parts = np.clip(3.0 * (places + 1.0), 0, 5).astype(np.intp)
    here = 36 * keys + 6 * parts[:, 0] + parts[:, 1]
    turn = _ranks(np.lexsort((roughness, level, here)), here)
    order = np.lexsort((roughness, turn, level, keys))
    rank = _ranks(order, keys)[order]
    candidates = (level[order] == 0) | (rank < per_bin_relaxed)
    cap = per_bin
    while cap > 1 and np.count_nonzero(candidates & (rank < cap)) > per_shot:
        cap -= 1
    kept = order[candidates & (rank < cap)]
    if len(kept) > per_shot:
        kept = kept[np.lexsort((roughness[kept], level[kept]))[:per_shot]]
    return np.sort(kept)


def _ranks(order: NDArray[np.intp], keys: NDArray[np.intp]) -> NDArray[np.intp]:
    """(n,): the place of each in its group of equal keys (n,), of which `order` has one after the other."""
    ranked, rank = keys[order], np.empty_like(order)
    rank[order] = np.arange(len(order)) - np.searchsorted(ranked, ranked, side="left")
    return rank
