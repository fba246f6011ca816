"""Fit the nodes of a cube to a known function by weighted least squares.

Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
reader's own interpolation has less than half of that error.
Points are plentiful, so the normal equations are well conditioned: conjugate gradients with a diagonal preconditioner
take a dozen steps, and no smoothness term is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.stats import qmc

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.model.lattice import grid
from lutforge.regression.normal_equations import normal_equations

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

POINTS_PER_CELL = 4
FEWEST_POINTS, MOST_POINTS = 1 << 16, 1 << 19
"""Bounds of the number of points; above the second one for each cell is enough beside its node."""
NODE_SHARE = 0.5
"""What a node counts beside a point: more, and the fit comes near to sampling."""
OVERHANG = 0.03
"""Share of the points beyond either end of an axis, clamped to its face: where inputs clip, they are many."""
GREY_WEIGHT = 30.0
GREY_POINTS = 1025
BLOCK = 1 << 16
"""Points between two words of progress."""
HOLD = 1e-3
"""Pull of a node towards the function's own value there, as a share of the mean weight of the data at a node."""
GOAL = 2e-4
MOST_STEPS = 60
POWER = 0.75
"""With which a second fit follows the errors of the first: an Lp norm of p = 2 + POWER."""
LEAST_FOLLOWED, MOST_FOLLOWED = 0.1, 20.0
"""Bounds of the errors that it follows, in units of their mean."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A function on the points of a fit: x, y (n, 3), the last `grey` of them the grey axis, before it the nodes.

    share: (n,), the share of all inputs that a point stands for; nodes: (N, N, N, 3), the values there.
    """

    x: Array
    y: Array
    grey: int
    share: Array
    nodes: Array


def sample(
    function: Function, levels: Levels, gain: Array, progress: Callable[[float], None] = lambda share: None
) -> Samples:
    """Evaluate a function (n, 3) in [0, 1] → (n, 3) for a fit at `levels`; gain: in front of it, as `fit_axes` has it.

    progress: called with the share of the points that is done.
    """
    size = len(levels[0])
    at_nodes = grid(levels).reshape(-1, 3)
    spread, share = _points(levels, gain)
    grey = np.repeat(np.linspace(0.0, 1.0, GREY_POINTS)[:, None], 3, axis=1)
    x = np.concatenate([spread, at_nodes, grey])
    y = np.empty_like(x)
    for start in range(0, len(x), BLOCK):
        progress(start / len(x))
        y[start : start + BLOCK] = function(x[start : start + BLOCK])
    nodes = y[len(spread) : -GREY_POINTS].reshape(size, size, size, 3).copy()
    shares = np.concatenate([share, NODE_SHARE * _node_share(levels), np.ones(GREY_POINTS)])
    return Samples(x, y, GREY_POINTS, shares, nodes)


def fit_cube(
    samples: Samples,
    knots: Levels,
    method: Interpolation,
    curve: Function | None = None,
    weight: Function | None = None,
    limit: bool = True,
) -> Array:
    """Node values (N, N, N, 3) at `knots` that come nearest to the samples under the given interpolation.

    Black and white are the function's own; the grey axis counts GREY_WEIGHT times. curve: inputs → the axes of the
    knots. weight: (n, 3) of outputs → (n,), how much a squared error counts there, as a response behind the cube
    magnifies it; then a second, reweighted fit (Lawson 1961) brings down the largest errors. limit: no node leaves the
    function's own range, whatever would fit best, so that a file keeps within the legal range.
    """
    y, nodes = samples.y, samples.nodes
    counts = None if weight is None else weight(y)
    omega = samples.share.copy() if counts is None else samples.share * counts
    omega[-samples.grey :] *= GREY_WEIGHT
    x = samples.x if curve is None else curve(samples.x)
    values = _solve(x, y, knots, method, omega / omega.mean(), nodes, nodes)
    if counts is not None:
        error = np.sqrt(counts * np.sum((interpolate(x, knots, values, method) - y) ** 2, axis=1))
        omega *= LEAST_FOLLOWED + np.minimum(error / max(float(error.mean()), 1e-300), MOST_FOLLOWED) ** POWER
        values = _solve(x, y, knots, method, omega / omega.mean(), nodes, values)
    if limit:
        values = np.clip(values, y.min(axis=0), y.max(axis=0))
    values[0, 0, 0], values[-1, -1, -1] = nodes[0, 0, 0], nodes[-1, -1, -1]
    return values


def _points(levels: Levels, gain: Array) -> tuple[Array, Array]:
    """Points (n, 3), even over the cells of the lattice, some of them on its faces; and the share of each (n,).

    Where a gain clips its inputs, many of them fall on the upper face. A share is the square root of the share of
    even inputs: half way between every input and every cell counting alike.
    """
    size = len(levels[0])
    cells = (size - 1) ** 3
    count = max(FEWEST_POINTS, min(POINTS_PER_CELL * cells, max(MOST_POINTS, cells)))
    u = qmc.Sobol(3, scramble=False).random(1 << int(np.ceil(np.log2(count))))[:count]
    even = np.linspace(0.0, 1.0, size)
    share = np.ones(count)
    x = np.empty_like(u)
    for c in range(3):
        beyond = max(1.0 - 1.0 / float(gain[c]), 0.0)
        above = max(OVERHANG, 0.25 * beyond**0.5)
        place = u[:, c] * (1 + OVERHANG + above) - OVERHANG
        cell = np.clip((place * (size - 1)).astype(np.int64), 0, size - 2)
        inside = np.diff(levels[c])[cell] * (size - 1)
        upper = max(beyond, OVERHANG) / above / (1.0 - beyond)
        share *= np.where(place > 1, upper, np.where(place < 0, 1.0, inside))
        x[:, c] = np.interp(np.clip(place, 0.0, 1.0), even, levels[c])
    share = np.sqrt(share)
    return x, share / share.mean()


def _node_share(levels: Levels) -> Array:
    """The same for the nodes, (N³,)."""
    widths = [np.gradient(axis) * (len(axis) - 1) for axis in levels]
    share = np.sqrt(np.einsum("i,j,k->ijk", *widths)).ravel()
    return np.asarray(share / share.mean())


def _solve(
    x: Array, y: Array, levels: Levels, method: Interpolation, omega: Array, sampled: Array, start: Array
) -> Array:
    """(W'ΩW + ε) b = W'Ωy + ε b₀ by conjugate gradients from `start`, the three outputs together."""
    equations = normal_equations(x, y, levels, method, omega)
    stencil, right = equations.stencil, equations.right
    hold = HOLD * float(stencil[..., 13].mean())
    stencil[..., 13] += hold
    right += hold * sampled
    inverse = 1 / stencil[..., 13:14]
    b = start.copy()
    residual = right - _apply(stencil, b)
    direction = preconditioned = inverse * residual
    rho = _dot(residual, preconditioned)
    goal = GOAL**2 * rho
    for _ in range(MOST_STEPS):
        if np.all(rho <= goal):
            break
        image = _apply(stencil, direction)
        step = rho / np.maximum(_dot(direction, image), 1e-300)
        b += step * direction
        residual -= step * image
        preconditioned = inverse * residual
        rho, previous = _dot(residual, preconditioned), rho
        direction = preconditioned + rho / np.maximum(previous, 1e-300) * direction
    if not np.all(np.isfinite(b)):
        raise LutError("the transform cannot be fitted by a cube: its values span too wide a range")
    return b


def _dot(a: Array, b: Array) -> Array:
    total: Array = np.einsum("ijkc,ijkc->c", a, b)
    return total


@njit(cache=True, parallel=True)
def _apply(stencil: Array, b: Array) -> Array:
    """The 27-point stencil (N, N, N, 27) times node values (N, N, N, 3)."""
    size_r, size_g, size_b = b.shape[0], b.shape[1], b.shape[2]
    result = np.empty_like(b)
    for plane in prange(size_r):
        i = np.int64(plane)  # the loop variable of prange is unsigned
        first = 1 if i == 0 else 0
        last = 2 if i == size_r - 1 else 3
        for j in range(size_g):
            for k in range(size_b):
                t0, t1, t2 = 0.0, 0.0, 0.0
                for di in range(first, last):
                    for dj in range(max(0, 1 - j), min(3, size_g + 1 - j)):
                        for dk in range(max(0, 1 - k), min(3, size_b + 1 - k)):
                            w = stencil[i, j, k, 9 * di + 3 * dj + dk]
                            t0 += w * b[i + di - 1, j + dj - 1, k + dk - 1, 0]
                            t1 += w * b[i + di - 1, j + dj - 1, k + dk - 1, 1]
                            t2 += w * b[i + di - 1, j + dj - 1, k + dk - 1, 2]
                result[i, j, k, 0], result[i, j, k, 1], result[i, j, k, 2] = t0, t1, t2
    return result
