"""Fit the nodes of a cube to a known function by weighted least squares.

Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
reader's own interpolation has less than half of that error.
Points are plentiful, so the normal equations are well conditioned: conjugate gradients with a diagonal preconditioner
take a dozen steps, and no smoothness term is needed.
"""

from collections.abc import Callable

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.errors import CalibrationError, LutError
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.model.lattice import grid
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.robust_weights import lawson

Function = Callable[[Array], Array]

GREY_POINTS = 1025
"""Points of the grey axis, beside those of the whole cube."""


def fit_cube(
    function: Function,
    levels: Levels,
    knots: Levels,
    method: Interpolation,
    gain: Array | float = 1.0,
    curve: Function | None = None,
    weight: Function | None = None,
    limit: bool = True,
    progress: Callable[[float], None] = lambda share: None,
) -> Array:
    """Node values (N, N, N, 3) at `levels` that come nearest to a function (n, 3) in [0, 1] → (n, 3), interpolated.

    knots: the levels on the axes of the cube, to which `curve` takes inputs. gain: in front of the function, as
    `measure_lines` has it. Black and white are the function's own; the grey axis counts 30 times. weight: (n, 3) of
    outputs → (n,), how much a squared error counts there, as an output curve behind the cube magnifies it; then a
    second, reweighted fit (Lawson 1961) brings down the largest errors. limit: no node leaves the function's own range,
    whatever would fit best, so that a file keeps within the legal range. progress: called with the share of the points
    at which the function is evaluated.
    """
    spread, on_face, counted = _points(levels, np.broadcast_to(gain, 3))
    count, at_nodes = len(spread), grid(levels)
    grey = np.repeat(np.linspace(0.0, 1.0, GREY_POINTS)[:, None], 3, axis=1)
    x = np.concatenate([spread, grey, at_nodes.reshape(-1, 3)])
    y = np.empty_like(x)
    for start in range(0, len(x), 1 << 16):
        progress(start / len(x))
        y[start : start + (1 << 16)] = function(x[start : start + (1 << 16)])
    nodes = y[count + GREY_POINTS :].reshape(at_nodes.shape)
    # A weight is the geometric mean of every input and every cell counting alike.
    cell_size = np.ones(count)
    for c, axis in enumerate(levels):
        widths = np.diff(axis) * (len(axis) - 1)
        cell = np.searchsorted(axis[1:-1], spread[:, c], side="right")
        cell_size *= np.where(on_face[:, c], 1.0, widths[cell])
    node_size = np.sqrt(np.einsum("i,j,k->ijk", *(np.gradient(axis) * (len(axis) - 1) for axis in levels))).ravel()
    share = counted / (np.sqrt(cell_size) * (1 / cell_size))
    # A node counts half of a point: more, and the fit comes near to sampling.
    omega = np.concatenate([share / share.mean(), np.ones(GREY_POINTS), 0.5 * node_size / node_size.mean()])
    order = np.r_[0:count, count + GREY_POINTS : len(x), count : count + GREY_POINTS]
    x, y, omega = x[order], y[order], omega[order]
    counts = None if weight is None else weight(y)
    if counts is not None:
        omega *= counts
    omega[-GREY_POINTS:] *= 30.0
    x = x if curve is None else curve(x)
    values = solve_nodes(x, y, knots, method, omega / omega.mean(), nodes, nodes)
    if counts is not None:
        error = np.sqrt(counts * np.sum((interpolate(x, knots, values, method) - y) ** 2, axis=1))
        omega *= lawson(error, 0.75)
        values = solve_nodes(x, y, knots, method, omega / omega.mean(), nodes, values)
    if limit:
        values = np.clip(values, y.min(axis=0), y.max(axis=0))
    values[0, 0, 0], values[-1, -1, -1] = nodes[0, 0, 0], nodes[-1, -1, -1]
    return values


def _points(levels: Levels, gain: Array) -> tuple[Array, Mask, Array]:
    """Points (n, 3), even over the cells, some of them on the faces of the cube.

    With them which coordinates were beyond an end of their axis and clamped to it, (n, 3), and a weight that corrects
    for how many inputs really lie there, (n,): where a gain clips its inputs, many of them fall on the upper face.
    """
    overhang = 0.03  # share of the points beyond either end of an axis, clamped to its face
    cells = (len(levels[0]) - 1) ** 3
    # Four points a cell; above half a million one for each is enough beside its node.
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
    # A node without points around it takes the function's own value: it counts a thousandth of the points of a node.
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
