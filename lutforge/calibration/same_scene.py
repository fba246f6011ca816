"""Whether two shots show one scene at about one exposure: then neither tests a fit to the other.

All surfaces of one scene have the same ratio of RAW between two shots, whatever the exposures are. Surfaces are matched
by their place in the picture where it is known, which serves a burst of a camera in the hand, too, since samples are of
flat areas; else by the name of their patch.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.samples.sample_set import SampleSet

SAME_PLACE = 0.02
"""Samples are of one surface within so much of the picture's half diagonal."""
LEAST_MATCHED = 12
"""The least number of surfaces that two shots of one scene have in common."""
LEAST_SHARE_MATCHED = 0.25
"""The least share of the samples of the smaller shot that are of these surfaces: shots are sampled in other areas."""
SPREAD_OF_RATIO = 0.1
"""Median deviation of the logarithms of the ratios of one scene, in stops; of two scenes it is above 0.3."""
OTHER_EXPOSURE = 0.45
"""Stops from which on a shot shows the scene at other tones: more than a third of a stop, and what shutters are off."""
LEAST_RAW = 1e-5
"""Smaller RAW values are raised to this before a logarithm."""


def is_one_scene(a: SampleSet, b: SampleSet) -> bool:
    """True where two shots of one style, on one white balance, show one scene at about one exposure."""
    if a.white_balance[0] != b.white_balance[0]:
        return False
    of_a, of_b = _same_surfaces(a, b)
    if len(of_a) < max(LEAST_MATCHED, LEAST_SHARE_MATCHED * min(len(a), len(b))):
        return False
    ratios = np.log2(np.maximum(a.raw[of_a], LEAST_RAW) / np.maximum(b.raw[of_b], LEAST_RAW))
    ratio = np.median(ratios, axis=0)
    spread = np.median(np.abs(ratios - ratio))
    return bool(spread < SPREAD_OF_RATIO and np.abs(ratio).max() < OTHER_EXPOSURE)


def _same_surfaces(a: SampleSet, b: SampleSet) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The samples of two shots that are of the same surfaces: rows of each, (m,)."""
    if np.isfinite(a.position).all() and np.isfinite(b.position).all():
        distance, nearest = cKDTree(b.position).query(a.position, distance_upper_bound=SAME_PLACE)
        of_a = np.flatnonzero(np.isfinite(distance))
        return of_a, np.asarray(nearest[of_a], dtype=np.intp)
    _, of_a, of_b = np.intersect1d(a.patch, b.patch, return_indices=True)
    return of_a, of_b
