"""Fit a cube to a known function: node levels from its curvature, node values by weighted least squares.

Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
reader's own interpolation has about half of that error, and its levels stand where the function bends (de Boor 1973).
Points are plentiful, so the normal equations are well conditioned: conjugate gradients with a diagonal preconditioner
take a dozen steps, and no smoothness term is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.stats import qmc

from lutforge.errors import LutError
from lutforge.interpolation import Interpolation, Levels
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.lattice import grid
from lutforge.regression.node_levels import snap_levels
from lutforge.regression.normal_equations import normal_equations

Array = NDArray[np.float64]
Function = Callable[[Array], Array]

LINES = 64
"""Lines along each axis on which the curvature is measured, and steps of each."""
STEPS = 256
EXPONENT = 1 / 4
"""Spacing ∝ κ^(−1/2), which evens out the largest errors of the cells; κ^(−2/5) would do it for their squares, at a
little less mean and much more maximum (de Boor 1973)."""
FLOOR = 0.2
"""Share of the nodes that stays evenly spread."""
POINTS_PER_CELL = 4
FEWEST_POINTS = 1 << 16
OVERHANG = 0.03
"""Share of the points beyond either end of an axis, clamped to its face: where inputs clip, they are many."""
GREY_WEIGHT = 30.0
GREY_SHARE = 0.5
"""What the grey axis counts among the lines."""
HOLD = 1e-3
"""Pull of a node towards the function's own value there, as a share of the mean weight of the data at a node."""
GOAL = 2e-4
MOST_STEPS = 60


def curvature_levels(
    function: Function,
    size: int,
    weight: Function | None = None,
    shared: bool = False,
    curve: Function | None = None,
) -> Levels:
    """Node levels of `size` per axis, snapped to the shaper's grid, dense where the function bends along that axis.

    function: (n, 3) in [0, 1] → (n, 3); weight: (n, 3) of outputs → (n,), how much an error counts there.
    shared: the same levels on all three axes. curve: (n, 3) inputs → the axes on which the cube is linear.
    """
    t = np.linspace(0.0, 1.0, STEPS + 1) ** 2  # finer in the darks, where responses are steep
    even = np.diff(t)
    places = t[:, None] * np.ones(3) if curve is None else curve(t[:, None] * np.ones(3))
    base = qmc.Sobol(2, scramble=False).random(LINES)
    base[: LINES // 2] = base[: LINES // 2] ** 2
    masses = []
    for axis in range(3):
        x = np.empty((LINES, STEPS + 1, 3))
        x[..., axis] = t
        others = [c for c in range(3) if c != axis]
        x[..., others] = base[:, None, :]
        x[0] = t[:, None]  # the grey axis
        y = function(x.reshape(-1, 3)).reshape(x.shape)
        step = np.diff(places[:, axis])
        slope = np.diff(y, axis=1) / step[:, None]
        bend = np.diff(slope, axis=1) * (2 / (step[1:] + step[:-1]))[:, None]
        square = np.sum(bend**2, axis=2)
        if weight is not None:
            square *= weight(y[:, 1:-1].reshape(-1, 3)).reshape(square.shape)
        mean = (1 - GREY_SHARE) * square[1:].mean(axis=0) + GREY_SHARE * square[0]
        density = gaussian_filter1d(np.pad(mean, 1, mode="edge") ** EXPONENT, 1.5, mode="nearest")
        mass = 0.5 * (density[1:] + density[:-1]) * step
        total = mass.sum()
        mass = (1 - FLOOR) * mass / total + FLOOR * even if total > 1e-12 else even
        masses.append(mass / mass.sum())
    if shared:
        masses = [np.mean(masses, axis=0)] * 3
    sums = [np.concatenate([[0.0], np.cumsum(mass)]) for mass in masses]
    r, g, b = (snap_levels(np.interp(np.linspace(0.0, total[-1], size), total, t), SHAPER_SIZE) for total in sums)
    return (r, g, b)


@dataclass(frozen=True, eq=False)
class Samples:
    """A function on the points of a fit: x, y (n, 3), the last `grey` of them the grey axis; nodes (N, N, N, 3)."""

    x: Array
    y: Array
    grey: int
    nodes: Array


def sample(function: Function, levels: Levels, grey: Array) -> Samples:
    """Evaluate a function (n, 3) → (n, 3) for a fit at `levels`; grey: the points of the grey axis, (n, 3)."""
    at_nodes = grid(levels)
    nodes = function(at_nodes.reshape(-1, 3)).reshape(at_nodes.shape)
    spread = _points(levels)
    x = np.concatenate([spread, at_nodes.reshape(-1, 3), grey])
    y = np.concatenate([function(spread), nodes.reshape(-1, 3), function(grey)])
    return Samples(x, y, len(grey), nodes)


def fit_cube(
    samples: Samples, levels: Levels, method: Interpolation, weight: Function | None = None, limit: bool = True
) -> Array:
    """Node values (N, N, N, 3) at `levels` that come nearest to the samples under the given interpolation.

    Black and white are the function's own; the grey axis counts GREY_WEIGHT times.
    weight: (n, 3) of outputs → (n,), how much an error counts there. limit: no node leaves the function's own range,
    whatever would fit best, so that a file keeps within the legal range.
    """
    x, y, nodes = samples.x, samples.y, samples.nodes
    omega = np.ones(len(x)) if weight is None else weight(y)
    omega[-samples.grey :] *= GREY_WEIGHT
    values = _solve(x, y, levels, method, omega / omega.mean(), nodes)
    if limit:
        values = np.clip(values, y.min(axis=0), y.max(axis=0))
    values[0, 0, 0], values[-1, -1, -1] = nodes[0, 0, 0], nodes[-1, -1, -1]
    return values


def _points(levels: Levels) -> Array:
    """Points (n, 3), even over the cells of the lattice, some of them on its faces."""
    size = len(levels[0])
    count = max(POINTS_PER_CELL * (size - 1) ** 3, FEWEST_POINTS)
    u = qmc.Sobol(3, scramble=False).random(1 << int(np.ceil(np.log2(count))))[:count]
    u = np.clip(u * (1 + 2 * OVERHANG) - OVERHANG, 0.0, 1.0)
    even = np.linspace(0.0, 1.0, size)
    return np.stack([np.interp(u[:, c], even, levels[c]) for c in range(3)], axis=1)


def _solve(x: Array, y: Array, levels: Levels, method: Interpolation, omega: Array, sampled: Array) -> Array:
    """(W'ΩW + ε) b = W'Ωy + ε b₀ by conjugate gradients, the three outputs together."""
    equations = normal_equations(x, y, levels, method, omega)
    stencil, right = equations.stencil, equations.right
    hold = HOLD * float(stencil[..., 13].mean())
    stencil[..., 13] += hold
    right += hold * sampled
    inverse = 1 / stencil[..., 13:14]
    b = sampled.copy()
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
