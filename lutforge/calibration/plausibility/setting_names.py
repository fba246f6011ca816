"""Finds white-balance names that do not match their multipliers: the warmer the light, the more blue a camera adds."""

from collections.abc import Mapping
from itertools import combinations

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.plausibility.known_cameras import known_cameras
from lutforge.model.diagnosis import Diagnosis


def wrong_names(multipliers: Mapping[str, Array]) -> Diagnosis | None:
    """Diagnose one setting that has another's name, or two that have each other's; None where all are in order.

    multipliers: (r, g, b) by name.
    """
    known = known_cameras()["red_over_blue"]
    names = [name for name in multipliers if name in known and name != "what"]
    makers = {"fluorescent": 0.3}  # log(red / blue) differs between makers by 0.1 for one setting, but lamps differ
    ratio = np.array([np.log(multipliers[name][0] / multipliers[name][2]) for name in names])

    def misfit(called: list[str]) -> float:
        """The negative log-likelihood of the ratios under these names; the mean of all ratios is free."""
        spread = np.array([np.hypot(known[name][1], makers.get(name, 0.1)) for name in called])
        departure = ratio - np.array([known[name][0] for name in called])
        centre = np.average(departure, weights=spread**-2.0)
        return float(0.5 * np.sum(((departure - centre) / spread) ** 2))

    free = [name for name in known if name not in names and name != "what"]
    renamings = [{name: other} for name in names for other in free]
    renamings += [{first: second, second: first} for first, second in combinations(names, 2)]
    best, found = 4.6, None  # log 100: prior odds of one in a hundred
    for renaming in renamings:
        gain = misfit(names) - misfit([renaming.get(name, name) for name in names])
        if gain > best:
            best, found = gain, renaming
    if found is None:
        return None
    first, second = next(iter(found.items()))
    if len(found) == 1:
        return Diagnosis(
            f'the white balance "{first}" has another\'s name',
            f'its multipliers, beside those of the other settings, are for the light of "{second}"',
            "name it in the table as it was set in the camera",
        )
    warm = min(found, key=lambda name: ratio[names.index(name)])
    return Diagnosis(
        f'the white balances "{first}" and "{second}" have each other\'s names',
        f'the multipliers of "{warm}" are for the warmer light of the two',
        "exchange the names in the table",
    )
