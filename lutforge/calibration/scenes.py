"""Likely scenes: linear values that a camera is likely to meet, given the samples of its calibration."""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Mask
from lutforge.model.gamut_map import GamutMap, from_even
from lutforge.sobol import sobol

COUNT = 20_000
"""Scenes that are drawn around samples."""
SCENE_OFFSET = 0.005
"""ε of the perceptual scale that scenes are spread over."""
REST = 0.02
"""The weight of a colour anywhere in the cube, where one near a sample has 1."""


@dataclass(frozen=True, eq=False)
class LikelyScenes:
    """White-balanced RAW (m, 3) and weights (m,)."""

    balanced: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class RenderedScenes:
    """Likely scenes and their rendering: balanced Tw E, linear X = Ts Tw E, mapped h(X), codes I, each (m, 3).

    gamut_map: h; weight: (m,); whole: (m,), the scenes of which neither RAW nor codes clip.
    """

    gamut_map: GamutMap
    balanced: Array
    weight: Array
    linear: Array
    mapped: Array
    codes: Array
    whole: Mask


def likely_scenes(samples: Array) -> LikelyScenes:
    """The samples, scenes near them, greys, and scenes anywhere in the cube; the same every time.

    samples: white-balanced RAW (n, 3). Scenes near a sample are normally distributed around it with the distance to its
    fourth neighbour, on the square root of linear values, which is near to perceptually uniform.
    """
    rng = np.random.default_rng(0)
    chosen = samples[rng.permutation(len(samples))[: COUNT // 2]]
    root = np.sqrt(np.clip(chosen, 0.0, 1.0))
    distance = cKDTree(root).query(root, k=[min(5, len(root))])[0]
    places = rng.integers(0, len(root), COUNT)
    near = (root[places] + 0.7 * distance[places] * rng.standard_normal((COUNT, 3))) ** 2
    near = near[np.all(near < 1.0, axis=1)]
    likely = np.concatenate([chosen, near, neutral_scenes(COUNT // 20)])
    anywhere = np.concatenate([sobol(COUNT // 4), from_even(sobol(COUNT // 4, seed=1), SCENE_OFFSET)])
    weight = np.concatenate([np.ones(len(likely)), np.full(len(anywhere), REST)])
    return LikelyScenes(np.concatenate([likely, anywhere]), weight)


def neutral_scenes(count: int) -> Array:
    """Near-neutral white-balanced RAW (count, 3) from black to saturation, at perceptually uniform steps.

    Red and blue differ from green by up to a tenth.
    """
    level, red, blue = sobol(count, seed=0).T
    colour = 1.0 + 0.1 * np.stack([2.0 * red - 1.0, np.zeros(count), 2.0 * blue - 1.0], axis=1)
    return np.asarray(from_even(level, SCENE_OFFSET)[:, None] * colour / colour.max(axis=1, keepdims=True))
