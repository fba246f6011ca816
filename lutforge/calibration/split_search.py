"""Search of the division of shots into two groups that fit best apart."""

from collections.abc import Callable

import numpy as np

from lutforge.arrays import Mask

MOST_FOR_ALL_SPLITS = 12
"""The largest number of shots of which all divisions into two groups are tried.

Of more shots, single ones are moved from group to group as long as that helps.
"""
SINGLE_STARTS, RANDOM_STARTS = 3, 4
"""From how many single shots, and from how many random divisions, such moves start."""
MOST_PASSES = 10
"""How often each shot is moved from group to group, at most."""


def best_split(count: int, error_saved: Callable[[Mask], float]) -> Mask:
    """The division of so many shots into two groups, a mask (s,), that saves most error.

    error_saved: the error that is saved where the shots of a mask (s,) are fitted apart from the others.
    """
    if count <= MOST_FOR_ALL_SPLITS:
        splits = [
            np.array([False, *(bits >> place & 1 for place in range(count - 1))], dtype=np.bool_)
            for bits in range(1, 1 << (count - 1))
        ]
        return max(splits, key=error_saved)

    places = np.arange(count)
    by_error_saved = sorted(range(count), key=lambda place: -error_saved(places == place))
    singles = [places == place for place in by_error_saved[:SINGLE_STARTS]]
    rng = np.random.default_rng(0)
    random = [rng.random(count) < 0.5 for _ in range(RANDOM_STARTS)]
    return max((_improved(start, error_saved) for start in [*singles, *random]), key=error_saved)


def _improved(start: Mask, error_saved: Callable[[Mask], float]) -> Mask:
    """The division (s,) that results from moving single shots from group to group while that saves more error."""
    split = start.copy()
    most_saved = error_saved(split)
    for _ in range(MOST_PASSES):
        saved_before_pass = most_saved
        for place in range(len(split)):
            split[place] = not split[place]
            has_two_groups = 0 < np.count_nonzero(split) < len(split)
            saved = error_saved(split) if has_two_groups else 0.0
            if saved > most_saved:
                most_saved = saved
            else:
                split[place] = not split[place]

        if most_saved <= saved_before_pass * (1 + 1e-9):
            break
    return split
