"""The nodes of a cube that is fitted to a known function.

Sampled at the nodes, a cube errs to the same side of the function in every cell; the least-squares cube under the
reader's interpolation has less than half of that error. Points are plentiful, so the normal equations are well
conditioned: conjugate gradients with a diagonal preconditioner take a dozen steps, without a smoothness term.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.errors import CalibrationError, LutError
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.model.lattice import grid
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.robust_weights import lawson

Function = Callable[[Array], Array]
"""A function of colours (n, 3)."""

GREY_POINTS = 1025
"""Points of the fit on the grey axis, in addition to those all over the cube."""

Share = Callable[[float], None]
"""A callback that gets the share of the points at which the function has been evaluated."""


@dataclass(frozen=True, eq=False)
class Axes:
    """The axes of a cube: node levels of the inputs, a curve per channel (…, 3), and knots: the levels after it."""

    levels: Levels
    knots: Levels
    curve: Function


def fit_cube(
    function: Function, axes: Axes, method: Interpolation, gain: Array, progress: Share = lambda share: None
) -> Array:
    """Node values (N, N, N, 3) that come nearest to a function (n, 3) in [0, 1] → (n, 3), interpolated.

    gain: (3,) before the function, as in `fit_axes`. Black and white are exact; the grey axis counts 30 times. Nodes
    are clamped to the range of the function, even where others would fit better: a file keeps to the legal range.
    """
    fit = _node_fit(function, axes, method, gain, lambda y: np.ones(len(y)), progress)
    values = fit.solved(fit.weight, fit.sampled)
    return fit.with_ends(np.clip(values, fit.y.min(axis=0), fit.y.max(axis=0)))


def fit_cube_before_curve(
    function: Function,
    axes: Axes,
    method: Interpolation,
    gain: Array,
    weight: Function,
    progress: Share = lambda share: None,
) -> Array:
    """Node values as in `fit_cube`, for a cube with an output curve after it that magnifies errors, and clips.

    weight: outputs (n, 3) → (n,), the weight of a squared error there. A second, reweighted fit (Lawson 1961) lowers
    the largest errors.
    """
    fit = _node_fit(function, axes, method, gain, weight, progress)
    values = fit.solved(fit.weight, fit.sampled)

    squared = np.sum((interpolate(fit.x, fit.knots, values, method) - fit.y) ** 2, axis=1)
    error = np.sqrt(weight(fit.y) * squared)
    return fit.with_ends(fit.solved(fit.weight * lawson(error, 0.75), values))


@dataclass(frozen=True, eq=False)
class _NodeFit:
    """The least-squares fit of a cube's nodes to a function's values y (m, 3) at points x (m, 3) on the cube's axes.

    weight: (m,), of the points; sampled: the function at the nodes (N, N, N, 3).
    """

    x: Array
    y: Array
    weight: Array
    sampled: Array
    knots: Levels
    method: Interpolation

    def solved(self, weight: Array, start: Array) -> Array:
        """The node values of least squares with weights (m,) of the points, by iterations from `start`."""
        return solve_nodes(self.x, self.y, self.knots, self.method, weight / weight.mean(), self.sampled, start)

    def with_ends(self, values: Array) -> Array:
        """Node values with the function's own black and white."""
        values[0, 0, 0] = self.sampled[0, 0, 0]
        values[-1, -1, -1] = self.sampled[-1, -1, -1]
        return values


def _node_fit(
    function: Function, axes: Axes, method: Interpolation, gain: Array, importance: Function, progress: Share
) -> _NodeFit:
    """The fit on points all over the cube, on the grey axis and at the nodes. importance: (n, 3) → (n,)."""
    levels = axes.levels
    spread, on_face, counted = _points(levels, gain)
    count = len(spread)
    at_nodes = grid(levels)
    grey = np.repeat(np.linspace(0.0, 1.0, GREY_POINTS)[:, None], 3, axis=1)
    x = np.concatenate([spread, grey, at_nodes.reshape(-1, 3)])

    y = np.empty_like(x)
    for start in range(0, len(x), 1 << 16):
        progress(start / len(x))
        y[start : start + (1 << 16)] = function(x[start : start + (1 << 16)])
    sampled = y[count + GREY_POINTS :].reshape(at_nodes.shape)

    # The weight of a point is the geometric mean of two: one gives all inputs the same weight, one all cells.
    cell_size = np.ones(count)
    for c, axis in enumerate(levels):
        widths = np.diff(axis) * (len(axis) - 1)
        cell = np.searchsorted(axis[1:-1], spread[:, c], side="right")
        cell_size *= np.where(on_face[:, c], 1.0, widths[cell])
    node_size = np.sqrt(np.einsum("i,j,k->ijk", *(np.gradient(axis) * (len(axis) - 1) for axis in levels))).ravel()
    share = counted / (np.sqrt(cell_size) * (1 / cell_size))

    # A node counts half of a point: more, and the fit comes near to sampling.
    weight = np.concatenate([share / share.mean(), np.ones(GREY_POINTS), 0.5 * node_size / node_size.mean()])
    order = np.r_[0:count, count + GREY_POINTS : len(x), count : count + GREY_POINTS]
    x, y, weight = x[order], y[order], weight[order]
    weight *= importance(y)
    weight[-GREY_POINTS:] *= 30.0
    # Black and white almost without error, so that the nodes around them are fitted to the exact ends.
    weight[[count, -GREY_POINTS - 1]] = 1e4 * weight.mean()

    return _NodeFit(axes.curve(x), y, weight, sampled, axes.knots, method)


def _points(levels: Levels, gain: Array) -> tuple[Array, Mask, Array]:
    """Points (n, 3), evenly many in each cell, some of them on the faces of the cube; a mask (n, 3); a weight (n,).

    The mask is of the coordinates that were beyond an end of their axis and are clamped to it. The weight corrects for
    how many inputs lie on the faces: where a gain clips its inputs, many of them fall on the upper one.
    """
    overhang = 0.03  # share of the points beyond either end of an axis, clamped to its face
    cells = (len(levels[0]) - 1) ** 3
    # Four points a cell, up to half a million points; in larger cubes one a cell is enough, besides its node.
    u = sobol(max(1 << 16, min(4 * cells, max(1 << 19, cells))))
    even = np.linspace(0.0, 1.0, len(levels[0]))
    counted = np.ones(len(u))
    on_face = np.empty(u.shape, dtype=np.bool_)
    x = np.empty_like(u)
    for c in range(3):
        beyond = max(1.0 - 1.0 / float(gain[c]), 0.0)
        above = max(overhang, 0.25 * beyond**0.5)
        place = u[:, c] * (1 + overhang + above) - overhang
        upper = max(beyond, overhang) / above / (1.0 - beyond)
        counted *= np.where(place > 1, np.sqrt(upper), 1.0)
        on_face[:, c] = (place > 1) | (place < 0)
        x[:, c] = np.interp(np.clip(place, 0.0, 1.0), even, levels[c])
    return x, on_face, counted


def solve_nodes(
    x: Array, y: Array, levels: Levels, method: Interpolation, omega: Array, sampled: Array, start: Array
) -> Array:
    """(W'ΩW + ε) b = W'Ωy + ε b₀ by conjugate gradients from `start`, the three outputs together; ω: 1 in the mean."""
    # A node without points around it takes the function's value, whose weight is far below that of a node's points.
    hold = np.full_like(sampled, 3e-4 * len(x) / sampled[..., 0].size)
    try:
        # A hundredth of the difference between the sampled cube and the best one remains. At the limit of iterations
        # more remains, but each iteration has brought the cube nearer to the function.
        solution = fit_lattice(
            x, y, levels, method=method, weight=omega, prior=Prior(sampled, hold), start=start, tolerance=1e-2, most=60
        )
    except CalibrationError as error:
        raise LutError("the transform cannot be fitted by a cube: its values span too wide a range") from error
    return solution.value
