"""The exact inverse of a render at the nodes of a linearization, continued to codes that the render never makes.

Behind the faces of the RAW range the render is continued by its mean slope on neutrals, so that the inverse runs on
where its range ends. A channel that is clipped says only that the scene is beyond, and it may be far to one that the
camera can take: the search begins from the profile's own answer, which is smooth from code to code, then from the scene
of the nearest colour that the render makes.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.ocio.made_colours import MadeColours
from lutforge.ocio.preimage import Render, preimages
from lutforge.ocio.unfolding import frame

Array = NDArray[np.float64]

REACH = 1.0
"""How far beyond the RAW range it is continued."""


def exact_inverse(pool: MadeColours, inner: Array, jpeg: Array, start: Array) -> Array:
    """RAW (n, 3), beyond [0, 1] where it must be, of JPEG colours (n, 3), `inner` in front of the response, for the
    render of the pool, which holds colours that it makes; searched from start (n, 3)."""
    render, beyond = pool.render, _continued(pool.render)

    def search(which: NDArray[np.int64], begin: Array) -> tuple[Array, NDArray[np.bool_]]:
        raw, found = preimages(beyond, inner[which], jpeg[which], (begin + REACH) / (1 + 2 * REACH))
        return raw * (1 + 2 * REACH) - REACH, found

    raw, reached = search(np.arange(len(jpeg)), np.clip(start, 0.0, 1.0))
    left = np.flatnonzero(~(reached & np.all((raw >= 0) & (raw <= 1), axis=1)))
    nearest = np.empty((0, 3))
    for again in (False, True):
        begin = pool.raw[cKDTree(pool.jpeg).query(jpeg[left])[1]] if again else np.clip(raw[left], 0.0, 1.0)
        nearest, found = preimages(render, inner[left], jpeg[left], begin)
        raw[left[found]] = nearest[found]
        left, nearest = left[~found], nearest[~found]
    other, found = search(left, np.clip(nearest, 0.0, 1.0))
    better = found & ((_outside(other) < _outside(raw[left])) | ~reached[left])
    raw[left[better]] = other[better]
    return raw


def _outside(raw: Array) -> Array:
    return np.asarray(np.linalg.norm(raw - np.clip(raw, 0.0, 1.0), axis=1))


def _continued(render: Render) -> Render:
    """The render on [−REACH, 1 + REACH], scaled to [0, 1], straight on beyond the RAW range."""
    levels = np.stack([np.concatenate([[-REACH], axis, [1 + REACH]]) for axis in render.levels])
    ends = np.zeros(len(levels[0]))
    ends[[0, -1]] = -REACH, REACH
    off = np.stack(np.meshgrid(ends, ends, ends, indexing="ij"), axis=-1)
    values = np.pad(render.values, [(1, 1)] * 3 + [(0, 0)], mode="edge") + off @ frame(render).T
    return replace(render, levels=(levels + REACH) / (1 + 2 * REACH), values=values)
