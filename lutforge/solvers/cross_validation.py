"""Cross-validation: errors on samples that a fit has not seen (Stone 1974, https://doi.org/10.1111/j.2517-6161.1974.tb00994.x).

Samples of one shot share its light, its exposure and its errors, so whole shots are held out, never parts of one.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

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
