"""Cross-validation: errors on samples that a fit has not seen (Stone 1974, https://doi.org/10.1111/j.2517-6161.1974.tb00994.x).

Samples of one shot share its light, its exposure and its errors, so whole shots are held out, never parts of one.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask


def leave_groups_out(groups: NDArray[np.str_], most: int = 5) -> list[Mask]:
    """The samples that each fold holds out, masks (n,): whole groups, and each sample once; groups: (n,) names.

    There is one fold a group, or `most` folds of several groups. Groups are dealt out in order of their sample counts,
    so that folds are of like size.
    """
    names, member, counts = np.unique(groups, return_inverse=True, return_counts=True)
    place = np.argsort(np.argsort(-counts, kind="stable"))
    folds = min(most, len(names))
    return [(place % folds == fold)[member] for fold in range(folds)]


ALIKE, ALIKE_SHARE = 5.0, 0.95
"""Samples of two groups are the same if they lie so near, and nearer than those of one group to each other: those of
a burst with 1 % of noise at 0.7 to 0.8 of that, of different photographs at 8 times it."""
COMPARED = 100
"""Samples of a group, at most, whose nearest neighbours in another group are compared."""


def joined_alike(groups: NDArray[np.str_], points: Array, are_one: Callable[[str, str], bool]) -> NDArray[np.str_]:
    """Names (n,) of groups (n,) in which those are one, under the first of their names, that are copies of each other.

    points: (n, k), what samples are, in units of which one is hardly seen. Groups are copies if the median
    distance from samples of either to the nearest of the other is smaller than from one to the next of its own group;
    so are the shots of a burst, and groups of which `are_one` is true, given the names of two.
    """
    names, member = np.unique(groups, return_inverse=True)
    parts = [points[member == place] for place in range(len(names))]
    trees = [cKDTree(part) for part in parts]
    rng = np.random.default_rng(0)
    some = [part[rng.permutation(len(part))[:COMPARED]] for part in parts]

    def distance(a: int, b: int) -> float:
        return float(np.median(trees[b].query(some[a])[0]))

    spacing = [float(np.median(tree.query(few, k=2)[0][:, 1])) for tree, few in zip(trees, some, strict=True)]
    pairs = [
        (a, b)
        for a in range(len(names))
        for b in range(a)
        if max(distance(a, b), distance(b, a)) < min(ALIKE, ALIKE_SHARE * max(spacing[a], spacing[b]))
        or are_one(str(names[a]), str(names[b]))
    ]
    rows, columns = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    links = coo_array((np.ones(len(pairs)), (rows, columns)), shape=(len(names), len(names)))
    label = connected_components(links, directed=False)[1]
    first = np.array([np.flatnonzero(label == group)[0] for group in label])
    return np.asarray(names[first][member])


def leave_samples_out(count: int, folds: int = 5) -> list[Mask]:
    """Return the samples that each fold holds out, masks (count,), where there are no groups: every `folds`-th one."""
    return [np.arange(count) % folds == fold for fold in range(folds)]


def predict_held_out(masks: Sequence[Mask], predict: Callable[[Mask, Mask], Array]) -> Array:
    """Predictions (n, …) of all samples, each by a fit that has not seen it.

    masks: (n,) samples that each fold holds out, disjoint, all samples together; predict(train, test): fits to the
    samples of the first mask, and returns what that predicts for those of the second, in their order.
    """
    parts = [predict(~mask, mask) for mask in masks]
    result = np.empty((len(masks[0]), *parts[0].shape[1:]))
    for mask, part in zip(masks, parts, strict=True):
        result[mask] = part
    return result
