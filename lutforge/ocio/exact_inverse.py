"""The exact inverse of a render at the nodes of a linearization, continued to codes that the render never makes.

Beyond the RAW range the render is continued, so that the inverse runs on where its range ends. A channel that is
clipped says only that the scene is beyond: of all scenes, the one is taken that is as little as can be outside of the
RAW range, then of the least beyond the clip, so that the answer changes smoothly from code to code.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.compiled import compiled
from lutforge.ocio.joint_equations import MARGIN
from lutforge.ocio.made_colours import MadeColours
from lutforge.ocio.preimage import Render, clipped_sides, preimages, value_and_slope
from lutforge.ocio.unfolding import continued, frame
from lutforge.threads import run, slabs

Array = NDArray[np.float64]
Index = NDArray[np.int64]

REACH = 1.0
"""How far beyond the RAW range it is continued."""
STAGES = ((0.1, 0.01), (0.03, 0.001), (0.01, 0.0001))
"""How much it counts to be outside of the RAW range, and beyond the clip, beside what is not clipped."""
STEPS = 60
BLOCK = 1024
"""Colours that a thread takes at once."""
BETTER = 0.9
"""Share of what is left from one start, for the other to be taken: else codes side by side might go either way."""


def exact_inverse(pool: MadeColours, beyond: Render, inner: Array, jpeg: Array, start: Array) -> Array:
    """RAW (n, 3), beyond [0, 1] where it must be, of JPEG colours (n, 3), `inner` in front of the response, for one
    that goes on beyond its range; searched from start (n, 3), and from the scenes of the pool's nearest colours."""
    wide = continued(beyond, frame(beyond), REACH)
    raw, reached = preimages(wide, inner, jpeg, np.clip(start, 0.0, 1.0))
    side = clipped_sides(jpeg)
    clipped = np.any(side != 0, axis=1)
    again = np.flatnonzero(~reached | clipped)
    near = pool.raw[cKDTree(pool.jpeg).query(jpeg[again])[1]]
    other, found = preimages(wide, inner[again], jpeg[again], near)
    better = found & ~reached[again]
    raw[again[better]] = other[better]
    raw[clipped] = _settled(wide, inner[clipped], side[clipped], (raw[clipped], near[clipped[again]]))
    return raw


def _settled(render: Render, target: Array, side: Index, starts: tuple[Array, Array]) -> Array:
    """Scenes of clipped codes (n, 3), `target` in front of the response, from the better of two starts (n, 3)."""
    answers, costs = [], []
    for start in starts:
        raw, cost = start.copy(), np.empty(len(start))
        for outside, clip in STAGES:
            settle = partial(
                _settle, render.values, render.levels, render.tetrahedral, target, side, outside, clip, raw, cost
            )
            run(settle, slabs(0, len(raw), BLOCK, len(raw)))
        answers.append(raw)
        costs.append(cost)
    return np.where((costs[1] < BETTER * costs[0])[:, None], answers[1], answers[0])


@compiled()
def _pulls(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    x: Array,
    target: Array,
    side: Index,
    outside: float,
    clip: float,
    left: Array,
    slope: Array,
) -> float:
    """Fill left (6,), what is left of a clipped code and of being within RAW 0 and 1, and slope (6, 3); its square."""
    y, total = np.empty(3), 0.0
    value_and_slope(values, levels, tetrahedral, x, y, slope[:3])
    for c in range(3):
        left[c] = target[c] + side[c] * MARGIN - y[c]
        if side[c] * left[c] < 0:
            left[c] *= clip
            slope[c] *= clip
        out = x[c] - min(max(x[c], 0.0), 1.0)
        left[3 + c] = -outside * out
        slope[3 + c] = 0.0
        slope[3 + c, c] = outside if out != 0.0 else 0.0
        total += left[c] ** 2 + left[3 + c] ** 2
    return total


@compiled()
def _settle(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    targets: Array,
    sides: Index,
    outside: float,
    clip: float,
    raw: Array,
    costs: Array,
    first: int,
    last: int,
) -> None:
    """Levenberg–Marquardt for some of the targets, in place; costs: what is left, squared (n,)."""
    left, other, slope, steep = np.empty(6), np.empty(6), np.empty((6, 3)), np.empty((6, 3))
    trial = np.empty(3)
    for n in range(first, last):
        x, target, side = raw[n], targets[n], sides[n]
        cost = _pulls(values, levels, tetrahedral, x, target, side, outside, clip, left, slope)
        damping = 1e-6
        for _ in range(STEPS):
            square, gradient = slope.T @ slope, slope.T @ left
            reached = cost
            for _ in range(8):
                for axis in range(3):
                    square[axis, axis] += damping + 1e-12
                trial[:] = x + np.linalg.solve(square, gradient)
                for axis in range(3):
                    trial[axis] = min(max(trial[axis], levels[axis, 0]), levels[axis, -1])
                reached = _pulls(values, levels, tetrahedral, trial, target, side, outside, clip, other, steep)
                if reached < cost:
                    break
                damping *= 10
            if not reached < cost:
                break
            settled = reached > (1 - 1e-7) * cost
            cost, damping = reached, damping * 0.1
            x[:], left[:], slope[:] = trial, other, steep
            if settled:
                break
        costs[n] = cost
