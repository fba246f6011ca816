"""Node values of a lattice that a render takes back to where they came from: Gauss–Newton on ‖render(lattice(I)) − I‖².

Each sample couples the three outputs of the four nodes around it through the slopes of the render, so the equations of
a step are never formed: conjugate gradients apply them sample by sample, with the 3 × 3 block of each node as the
preconditioner. The change from a prior is kept smooth, which continues it where no colour is. O(n + N³) an iteration.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray

from lutforge.interpolation import Levels, locate
from lutforge.ocio.preimage import CLIPPED, Render, value_and_slope
from lutforge.regression.smoothness import second_difference, to_bands

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SMOOTHNESS, HOLD = 1e-4, 1e-6
"""Weights of the second differences of the change from the prior, and of the change itself, beside the data's."""
OUTSIDE = 0.3
"""Slope of the residual beyond the RAW range and beyond the ends of the response, where the render itself is flat."""
BARELY = 0.02
"""Of a lattice value beyond the end of the response: a clipped channel nearer than this is held back from returning."""
EMPHASIS, POWER = 2e-3, 0.5
"""Residual at which a colour begins to count more than others, and with which power, so that the largest come down."""
ENOUGH = 0.97
"""Share of the cost that a step must leave less than, to be followed by another."""
CHUNKS = 4
"""Parts whose sums are taken apart: as many on every machine, so that the result does not depend on its cores."""


@dataclass(frozen=True, eq=False)
class Places:
    """Samples in a lattice of tetrahedra: the four nodes (n, 4) that each lies between, and their weights (n, 4)."""

    nodes: Index
    weights: Array


def places(x: Array, levels: Levels) -> Places:
    """Where x (n, 3) lies in a lattice."""
    nodes, weights = np.empty((len(x), 4), dtype=np.int64), np.empty((len(x), 4))
    _places(np.ascontiguousarray(x), *levels, nodes, weights)
    return Places(nodes, weights)


def refine(render: Render, jpeg: Array, at: Places, start: Array, prior: Array, steps: int) -> Array:
    """Node values (N, N, N, 3), RAW, that the render takes nearer to the JPEG colours (n, 3) at `at` than `start` does.

    prior: (N, N, N, 3), towards which the change is smooth.
    """
    shape = start.shape
    values, origin = start.reshape(-1, 3).copy(), prior.reshape(-1, 3)
    count = len(jpeg)
    left, slopes = np.empty((count, 3)), np.empty((count, 3, 3))
    trial_left, trial_slopes = np.empty_like(left), np.empty_like(slopes)
    parts = (render.values, render.levels, render.tetrahedral, render.response)
    bend = second_difference(np.linspace(0.0, 1.0, shape[0]))
    bands = to_bands(bend.T @ bend)
    damping, scale = 1e-3, 0.0
    _residuals(*parts, jpeg, at.nodes, at.weights, values, left, slopes)
    for _ in range(steps):
        emphasis = (np.sqrt(np.einsum("ni,ni->n", left, left)) + EMPHASIS) ** POWER
        emphasis /= emphasis.mean()
        blocks = np.einsum("nji,njk,n->nik", slopes, slopes, emphasis)
        scale = scale or float(np.einsum("njj->n", blocks).mean()) / 3 * count / len(values)
        system = _System(at, blocks, bands * (SMOOTHNESS * scale), HOLD * scale, shape)
        change = values - origin
        right = system.gathered(np.einsum("nji,nj,n->ni", slopes, left, emphasis)) - system.smooth(change)
        cost = _cost(left, emphasis) + float(np.sum(change * system.smooth(change)))
        for _ in range(6):
            trial = values + system.solve(right, damping)
            _residuals(*parts, jpeg, at.nodes, at.weights, trial, trial_left, trial_slopes)
            change = trial - origin
            reached = _cost(trial_left, emphasis) + float(np.sum(change * system.smooth(change)))
            if reached < cost:
                break
            damping *= 10
        else:
            break
        values, damping = trial, max(damping / 5, 1e-6)
        left, trial_left, slopes, trial_slopes = trial_left, left, trial_slopes, slopes
        if reached > ENOUGH * cost:
            break
    return values.reshape(shape)


def _cost(left: Array, weight: Array) -> float:
    return float(np.einsum("ni,ni,n->", left, left, weight))


@dataclass(frozen=True, eq=False)
class _System:
    """The equations of one step, W' B W + λ S + hold, for blocks B (n, 3, 3). bands: λ S'S of an axis, (N, 5)."""

    at: Places
    blocks: Array
    bands: Array
    hold: float
    shape: tuple[int, ...]

    def gathered(self, at_samples: Array) -> Array:
        """W' of (n, 3): (N³, 3)."""
        total = np.zeros((int(np.prod(self.shape[:3])), 3))
        _gather(self.at.nodes, self.at.weights, at_samples, total)
        return total

    def smooth(self, change: Array) -> Array:
        """(λ S + hold) change, (N³, 3)."""
        result = self.hold * change.reshape(self.shape)
        _smooth(self.bands, change.reshape(self.shape), result)
        return result.reshape(-1, 3)

    def solve(self, right: Array, damping: float, most: int = 40, goal: float = 1e-4) -> Array:
        """Conjugate gradients; right (N³, 3) → step (N³, 3)."""
        own = np.zeros((len(right), 3, 3))
        _own_blocks(self.at.nodes, self.at.weights, self.blocks, own)
        diagonal = np.einsum("njj->nj", own)
        extra = damping * (diagonal + 1e-3 * diagonal.mean())
        bend = self.bands[:, 2]
        along = bend[:, None, None] + bend[None, :, None] + bend[None, None, :]
        own[:, range(3), range(3)] += extra + along.reshape(-1, 1) + self.hold
        inverse = np.linalg.inv(own)
        step, residual = np.zeros_like(right), right.copy()
        preconditioned = np.einsum("nij,nj->ni", inverse, residual)
        direction = preconditioned.copy()
        rho = first = float(np.sum(residual * preconditioned))
        for _ in range(most):
            if rho <= goal * first:
                break
            sums = np.zeros((CHUNKS, *right.shape))
            _through(self.at.nodes, self.at.weights, self.blocks, direction, sums)
            image = sums.sum(axis=0) + self.smooth(direction) + extra * direction
            length = rho / float(np.sum(direction * image))
            step += length * direction
            residual -= length * image
            preconditioned = np.einsum("nij,nj->ni", inverse, residual)
            rho, previous = float(np.sum(residual * preconditioned)), rho
            direction = preconditioned + rho / previous * direction
        return step


@njit(cache=True)
def _places(x: Array, r: Array, g: Array, b: Array, nodes: Index, weights: Array) -> None:
    strides, fraction = np.array([len(g) * len(b), len(b), 1]), np.empty(3)
    for n in range(len(x)):
        i, fraction[0] = locate(r, x[n, 0])
        j, fraction[1] = locate(g, x[n, 1])
        k, fraction[2] = locate(b, x[n, 2])
        order = np.argsort(-fraction)
        node, rest = i * strides[0] + j * strides[1] + k, 1.0
        for corner in range(3):
            share = fraction[order[corner]]
            nodes[n, corner], weights[n, corner] = node, rest - share
            node, rest = node + strides[order[corner]], share
        nodes[n, 3], weights[n, 3] = node, rest


@njit(cache=True, parallel=True)
def _residuals(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    response: Array,
    jpeg: Array,
    nodes: Index,
    weights: Array,
    lattice: Array,
    left: Array,
    slopes: Array,
) -> None:
    """left (n, 3): JPEG − render(lattice), rising on where the render is flat; slopes (n, 3, 3): its change by RAW."""
    last, count, block = len(response) - 1, len(jpeg), 1024
    for start in prange((count + block - 1) // block):
        raw, inside, y, slope = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
        for n in range(start * block, min(count, (start + 1) * block)):
            for c in range(3):
                raw[c] = 0.0
                for corner in range(4):
                    raw[c] += weights[n, corner] * lattice[nodes[n, corner], c]
                inside[c] = min(max(raw[c], 0.0), 1.0)
            value_and_slope(values, levels, tetrahedral, inside, y, slope)
            for c in range(3):
                beyond = min(y[c], 0.0) + max(y[c] - 1.0, 0.0)
                if beyond != 0.0:
                    encoded, steep = response[0 if beyond < 0 else last, c] + OUTSIDE * beyond, OUTSIDE
                else:
                    place = min(int(y[c] * last), last - 1)
                    steep = (response[place + 1, c] - response[place, c]) * last
                    encoded = response[place, c] + (y[c] * last - place) * (response[place + 1, c] - response[place, c])
                rest = jpeg[n, c] - encoded
                if (jpeg[n, c] >= 1 - CLIPPED and y[c] >= 1) or (jpeg[n, c] <= CLIPPED and y[c] <= 0):
                    rest = 0.0  # clipped, as it should be
                    if abs(beyond) > BARELY:
                        steep = 0.0
                out = raw[c] - inside[c]
                left[n, c] = rest - OUTSIDE * out
                for axis in range(3):
                    slopes[n, c, axis] = steep * slope[c, axis] if raw[axis] == inside[axis] else 0.0
                if out != 0.0:
                    slopes[n, c, c] += OUTSIDE


@njit(cache=True)
def _gather(nodes: Index, weights: Array, at_samples: Array, total: Array) -> None:
    for n in range(len(nodes)):
        for corner in range(4):
            for c in range(3):
                total[nodes[n, corner], c] += weights[n, corner] * at_samples[n, c]


@njit(cache=True)
def _own_blocks(nodes: Index, weights: Array, blocks: Array, own: Array) -> None:
    """The diagonal blocks of W' B W, (N³, 3, 3)."""
    for n in range(len(nodes)):
        for corner in range(4):
            w = weights[n, corner] ** 2
            for c in range(3):
                for d in range(3):
                    own[nodes[n, corner], c, d] += w * blocks[n, c, d]


@njit(cache=True, parallel=True)
def _through(nodes: Index, weights: Array, blocks: Array, direction: Array, sums: Array) -> None:
    """W' B W direction, in CHUNKS sums."""
    count = len(nodes)
    for chunk in prange(CHUNKS):
        total, x = sums[chunk], np.empty(3)
        for n in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            for c in range(3):
                x[c] = 0.0
                for corner in range(4):
                    x[c] += weights[n, corner] * direction[nodes[n, corner], c]
            for c in range(3):
                y = blocks[n, c, 0] * x[0] + blocks[n, c, 1] * x[1] + blocks[n, c, 2] * x[2]
                for corner in range(4):
                    total[nodes[n, corner], c] += weights[n, corner] * y


@njit(cache=True)
def _smooth(bands: Array, b: Array, total: Array) -> None:
    """Add the penalty of second differences along each axis."""
    size = b.shape[0]
    for i in range(size):
        for j in range(size):
            for k in range(size):
                for d in range(-2, 3):
                    for c in range(3):
                        if 0 <= i + d < size:
                            total[i, j, k, c] += bands[i, d + 2] * b[i + d, j, k, c]
                        if 0 <= j + d < size:
                            total[i, j, k, c] += bands[j, d + 2] * b[i, j + d, k, c]
                        if 0 <= k + d < size:
                            total[i, j, k, c] += bands[k, d + 2] * b[i, j, k + d, c]
