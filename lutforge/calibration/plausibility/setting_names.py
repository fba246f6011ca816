"""Finds white-balance names that do not match their multipliers: the warmer the light, the more blue a camera adds."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.plausibility.known_cameras import known_cameras
from lutforge.model.diagnosis import Diagnosis


def exchanged_names(multipliers: Mapping[str, Array]) -> Diagnosis | None:
    """Diagnose two settings that have each other's names; multipliers: (r, g, b) by name. None where none have."""
    known = known_cameras()["red_over_blue"]
    names = [name for name in multipliers if name in known and name != "what"]
    makers = {"fluorescent": 0.3}  # log(red / blue) differs between makers by 0.1 for one setting, but lamps differ
    ratio = np.array([np.log(multipliers[name][0] / multipliers[name][2]) for name in names])

    def misfit(order: list[int]) -> float:
        """The negative log-likelihood of the ratios under names in this order; the mean of all ratios is free."""
        spread = np.array([np.hypot(known[names[place]][1], makers.get(names[place], 0.1)) for place in order])
        departure = ratio - np.array([known[names[place]][0] for place in order])
        centre = np.average(departure, weights=spread**-2.0)
        return float(0.5 * np.sum(((departure - centre) / spread) ** 2))

    given = list(range(len(names)))
    best, found = 4.6, None  # log 100: prior odds of one in a hundred
    for first, second in combinations(given, 2):
        order = given.copy()
        order[first], order[second] = second, first
        if misfit(given) - misfit(order) > best:
            best, found = misfit(given) - misfit(order), (names[first], names[second])
    if found is None:
        return None
    warm = min(found, key=lambda name: ratio[names.index(name)])
    return Diagnosis(
        f'the white balances "{found[0]}" and "{found[1]}" have each other\'s names',
        f'the multipliers of "{warm}" are for the warmer light of the two',
        "exchange the names in the table",
    )
