"""A render without folds: the cube nearest to it that takes no two scenes to one colour, a little beyond its range.

Far from all samples, a fitted render turns back here and there, and there no linearization can be its inverse. Taken
after the inverse of a frame, the camera's mean slope A on near neutrals, a colour rendering is nearly the identity;
where the symmetric part of its slope J A⁻¹ is positive definite everywhere, it is one to one on the whole (convex)
range, and its inverse no steeper than 1 / LEAST. In a cell, trilinear or of tetrahedra, the slope is a mean of few that
are linear in the nodes, so such cubes are a convex set. The nearest is found by minimising

    (Σ w ‖y − y₀‖² + Σ b ‖y − ȳ‖²) / μ + Σ v ‖(sym(J A⁻¹) − LEAST)₋‖²

for rising μ by L-BFGS: a change counts by what it changes encoded, by far the most where samples are, and least where
a channel stays clipped; where no samples are, so does a bend, from the line ȳ between two neighbours, as no inverse
on nodes of its own follows it. The cube has a node more at each end, where it runs on without a bend; the one below
RAW 0 stays: so the inverse has no kink there, and colours that the render made before keep a scene. What is beyond
RAW 1 is saturated. O(N³) an iteration.
"""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, permutations, product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lutforge.compiled import compiled
from lutforge.ocio.preimage import Render
from lutforge.solvers.blas import one_blas_thread
from lutforge.threads import run

Array = NDArray[np.float64]
Index = NDArray[np.int64]

MARGIN = 1 / 12
"""How far below RAW 0 it goes on: 0 stays on the grid of a shaper of 4096 entries from there to 1."""
LEAST = 0.15
"""Least eigenvalue of the symmetric part of the slope, beside 1 at near neutrals."""
SUPPORTED = 600.0
"""How much more a change counts at a node that half of those with samples have less of."""
BEYOND = 1e-3
"""How much a change counts of a channel that was clipped and stays so."""
BENDING, AROUND = 3.0, 1e-4
"""How much a bend counts beside a change, where no samples are; and a change of the nodes beyond the range."""
FIRMNESS, STEPS = (1.0, 10.0, 100.0), 120
"""μ, and most L-BFGS steps at each."""
LEAST_SLOPE = 0.3
"""Of the response, encoded: less does not make a change cheaper."""
NEAR_NEUTRAL = 0.25
"""Cells whose channels differ by less than this share of the largest make the frame."""
SLABS = 4
"""Parts whose sums are taken apart, as many on every machine."""


@one_blas_thread
def unfolded(render: Render, support: Array | None, fixed: NDArray[np.bool_]) -> Render:
    """With a node more at each end of each axis. support: what samples weigh at each node, (N, N, N), or none; fixed:
    nodes to keep, (N, N, N)."""
    edges, mean = _edges(render.tetrahedral), frame(render)
    inverse: Array = np.asarray(np.linalg.inv(mean), dtype=np.float64)
    weights = _encoded_slopes(render) ** 2
    weights = weights / weights.mean()
    bending = np.zeros_like(weights)
    if support is not None and support.shape == render.values.shape[:3] and support.max() > 0:
        there = share_of_samples(support)[..., None]
        weights, bending = weights * (1 + SUPPORTED * there), BENDING * weights * (1 - there)
    around = [(1, 1)] * 3 + [(0, 0)]
    bending = np.pad(bending, around, mode="edge")
    weights = np.pad(weights, around, constant_values=AROUND)
    fixed = np.pad(fixed, 1)
    render = continued(render, mean, MARGIN)
    origin = render.values
    low, high = origin <= 0, origin >= 1
    volumes = _volumes(render)
    volumes = volumes / (volumes.mean() * len(edges))
    limits = np.linspace(0, len(volumes), SLABS + 1).astype(np.int64)
    parts = [(int(first), int(last)) for first, last in pairwise(limits) if last > first]

    def cost(flat: Array, firmness: float) -> tuple[float, Array]:
        y = flat.reshape(origin.shape)
        stays = (low & (y < 0)) | (high & (y > 1))
        share = np.where(stays, BEYOND, weights)
        change = np.where(stays, y - origin, y - np.clip(origin, 0.0, 1.0))
        costs, gradients = np.zeros(len(parts)), [np.zeros(origin.shape) for _ in parts]

        def folds(begin: int, end: int) -> None:
            for k in range(begin, end):
                costs[k] = _folds(y, render.levels, edges, inverse, volumes, *parts[k], gradients[k])

        run(folds, list(pairwise(range(len(parts) + 1))))
        bends, bend_slope = _bends(y, render.levels, bending)
        slope = sum(gradients, start=np.zeros(())) + (share * change + bend_slope) / firmness
        slope[fixed] = 0.0
        return float(costs.sum() + (0.5 * np.sum(share * change * change) + bends) / firmness), slope.ravel()

    values = origin.ravel()
    for firmness in FIRMNESS:
        values = minimize(
            cost, values, (firmness,), "L-BFGS-B", jac=True, options={"maxiter": STEPS, "maxcor": 20}
        ).x  # fmt: skip
    return replace(render, values=np.asarray(values.reshape(origin.shape), dtype=np.float64))


def share_of_samples(support: Array) -> Array:
    """What samples weigh at nodes, beside what half of those with samples have less of, at most 1."""
    return np.asarray(np.minimum(support / np.median(support[support > 0]), 1.0))


def continued(render: Render, slope: Array, reach: float) -> Render:
    """With a node more at each end, `reach` beyond, on a slope (3, 3)."""
    levels = np.pad(render.levels, [(0, 0), (1, 1)], mode="edge")
    levels[:, 0] -= reach
    levels[:, -1] += reach
    ends = np.zeros(len(levels[0]))
    ends[[0, -1]] = -reach, reach
    off = np.stack(np.meshgrid(ends, ends, ends, indexing="ij"), axis=-1)
    values = np.pad(render.values, [(1, 1)] * 3 + [(0, 0)], mode="edge") + off @ slope.T
    return replace(render, levels=levels, values=values)


def _bends(y: Array, levels: Array, weights: Array) -> tuple[float, Array]:
    """½ Σ b ‖y − ȳ‖² along each axis, and its gradient."""
    total, gradient = 0.0, np.zeros(y.shape)
    for axis, nodes in enumerate(levels):
        z, g, w = (np.moveaxis(a, axis, 0) for a in (y, gradient, weights))
        share = ((nodes[1:-1] - nodes[:-2]) / (nodes[2:] - nodes[:-2]))[:, None, None, None]
        off = z[1:-1] - (1 - share) * z[:-2] - share * z[2:]
        pull = w[1:-1] * off
        total += 0.5 * float(np.sum(pull * off))
        g[1:-1] += pull
        g[:-2] -= (1 - share) * pull
        g[2:] -= share * pull
    return total, gradient


def frame(render: Render) -> Array:
    """A: mean slope, (3, 3), of the cells of unclipped near neutrals."""
    slopes = np.mean(list(_slopes(render)), axis=0)
    middle = [(axis[1:] + axis[:-1]) / 2 for axis in render.levels]
    raw = np.stack(np.meshgrid(*middle, indexing="ij"), axis=-1)
    values = render.values[:-1, :-1, :-1] / 2 + render.values[1:, 1:, 1:] / 2
    inside = np.all((values > 0) & (values < 1), axis=-1)
    inside &= np.ptp(raw, axis=-1) < NEAR_NEUTRAL * raw.max(axis=-1)
    if not inside.any():
        inside[:] = True
    return np.asarray(np.average(slopes[inside], axis=0, weights=_volumes(render)[inside]))


def folded_share(render: Render) -> float:
    """Share of the range, by volume, whose slope, in the frame, is not positive definite."""
    inverse, total = np.linalg.inv(frame(render)), 0.0
    edges, volumes = _edges(render.tetrahedral), _volumes(render)
    for slope in _slopes(render):
        relative = slope @ inverse
        least = np.linalg.eigvalsh((relative + np.swapaxes(relative, -1, -2)) / 2)[..., 0]
        total += float(np.sum(volumes * (least < 0)))
    return total / len(edges) / float(volumes.sum())


def _edges(tetrahedral: bool) -> Index:
    """Where the edges along r, g and b begin in a cell, (K, 3, 3), for each slope there: of its six tetrahedra, or of
    the eight corners whose mean, weighted as the values are, every slope of a trilinear cell is."""
    if not tetrahedral:
        corners = np.array(list(product((0, 1), repeat=3)), dtype=np.int64)
        return corners[:, None] * (1 - np.eye(3, dtype=np.int64))
    found = np.zeros((6, 3, 3), dtype=np.int64)
    for begins, order in zip(found, permutations(range(3)), strict=True):
        begins[order[1:], order[0]] = begins[order[2], order[1]] = 1
    return found


def _slopes(render: Render) -> Iterator[Array]:
    """For each of the edges' slopes, that in all cells (N − 1, N − 1, N − 1, 3, 3)."""
    count = len(render.levels[0]) - 1
    for begins in _edges(render.tetrahedral):
        slope = np.empty((count, count, count, 3, 3))
        for axis, (r, g, b) in enumerate(begins):
            first = render.values[r : r + count, g : g + count, b : b + count]
            r, g, b = (int(at) + (axis == other) for other, at in enumerate((r, g, b)))
            width = np.diff(render.levels[axis]).reshape([-1 if axis == other else 1 for other in range(3)] + [1])
            slope[..., axis] = (render.values[r : r + count, g : g + count, b : b + count] - first) / width
        yield slope


def _volumes(render: Render) -> Array:
    r, g, b = np.diff(render.levels, axis=1)
    return np.asarray(r[:, None, None] * g[:, None] * b)


def _encoded_slopes(render: Render) -> Array:
    """Slope of the response at the nodes, (N, N, N, 3)."""
    last = len(render.response) - 1
    rise = np.diff(render.response, axis=0) * last
    place = np.clip((render.values.reshape(-1, 3) * last).astype(np.int64), 0, last - 1)
    return np.maximum(np.take_along_axis(rise, place, axis=0), LEAST_SLOPE).reshape(render.values.shape)


@compiled()
def _folds(
    y: Array, levels: Array, edges: Index, inverse: Array, volumes: Array, first: int, last: int, gradient: Array
) -> float:
    """½ Σ v ‖(sym(J A⁻¹) − LEAST)₋‖² of the cells first … last of the first axis; its gradient is added."""
    total, size = 0.0, volumes.shape[1]
    slope, part, vectors, values = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty(3)
    for i in range(first, last):
        for j in range(size):
            for k in range(size):
                for e in range(len(edges)):
                    _slope(y, levels, edges[e], i, j, k, slope)
                    for p in range(3):
                        for q in range(p + 1):
                            one = other = 0.0
                            for axis in range(3):
                                one += slope[p, axis] * inverse[axis, q]
                                other += slope[q, axis] * inverse[axis, p]
                            part[p, q] = part[q, p] = (one + other) / 2
                    if _is_above(part, LEAST):
                        continue
                    _eigen(part, vectors, values)
                    v = volumes[i, j, k]
                    for p in range(3):
                        for q in range(3):
                            part[p, q] = 0.0
                            for m in range(3):
                                part[p, q] += v * min(values[m] - LEAST, 0.0) * vectors[p, m] * vectors[q, m]
                    for m in range(3):
                        total += 0.5 * v * min(values[m] - LEAST, 0.0) ** 2
                    for axis in range(3):
                        width = levels[axis, (i, j, k)[axis] + 1] - levels[axis, (i, j, k)[axis]]
                        p, q, r = i + edges[e, axis, 0], j + edges[e, axis, 1], k + edges[e, axis, 2]
                        for c in range(3):
                            pull = 0.0
                            for d in range(3):
                                pull += part[c, d] * inverse[axis, d]
                            pull /= width
                            gradient[p + (axis == 0), q + (axis == 1), r + (axis == 2), c] += pull
                            gradient[p, q, r, c] -= pull
    return total


@compiled()
def _slope(y: Array, levels: Array, begins: Index, i: int, j: int, k: int, slope: Array) -> None:
    for axis in range(3):
        width = levels[axis, (i, j, k)[axis] + 1] - levels[axis, (i, j, k)[axis]]
        p, q, r = i + begins[axis, 0], j + begins[axis, 1], k + begins[axis, 2]
        for c in range(3):
            slope[c, axis] = (y[p + (axis == 0), q + (axis == 1), r + (axis == 2), c] - y[p, q, r, c]) / width


@compiled()
def _is_above(s: Array, least: float) -> bool:
    """Whether all eigenvalues of a symmetric (3, 3) are: by its leading minors."""
    a, d, f = s[0, 0] - least, s[1, 1] - least, s[2, 2] - least
    b, c, e = s[0, 1], s[0, 2], s[1, 2]
    minor = a * d - b * b
    return bool(a > 0 and minor > 0 and f * minor - a * e * e - d * c * c + 2 * b * c * e > 0)


@compiled()
def _eigen(s: Array, vectors: Array, values: Array) -> None:
    """Jacobi's method on a symmetric (3, 3), which is spent."""
    vectors[:] = 0.0
    for p in range(3):
        vectors[p, p] = 1.0
    for _ in range(8):
        if s[0, 1] ** 2 + s[0, 2] ** 2 + s[1, 2] ** 2 <= 1e-22 * (s[0, 0] ** 2 + s[1, 1] ** 2 + s[2, 2] ** 2):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if s[p, q] == 0.0:
                    continue
                theta = (s[q, q] - s[p, p]) / (2 * s[p, q])
                t = (1.0 if theta >= 0 else -1.0) / (abs(theta) + np.sqrt(theta * theta + 1))
                cosine = 1 / np.sqrt(t * t + 1)
                sine = t * cosine
                for m in range(3):
                    s[m, p], s[m, q] = cosine * s[m, p] - sine * s[m, q], sine * s[m, p] + cosine * s[m, q]
                    vectors[m, p], vectors[m, q] = (
                        cosine * vectors[m, p] - sine * vectors[m, q],
                        sine * vectors[m, p] + cosine * vectors[m, q],
                    )
                for m in range(3):
                    s[p, m], s[q, m] = cosine * s[p, m] - sine * s[q, m], sine * s[p, m] + cosine * s[q, m]
    for p in range(3):
        values[p] = s[p, p]
