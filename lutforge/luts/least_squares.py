"""Fit a cube to a known function: input curves and node levels along its axes, then its nodes by least squares.

A cube interpolates linearly between its nodes, so each axis is first stretched until the function rises evenly along
it: the curve is the running sum of its root-mean-square slope, which leaves, of all curves, the least curvature on
average (d/dx log u' = ⟨F_xx, F_x⟩ / ⟨F_x, F_x⟩). Node levels then even out what curvature is left: intervals of width h
carry a mean error ∝ |κ| h² per unit length of the curve, and at a fixed number of them the total is least where 1/h ∝
|κ|^(1/3), the largest where 1/h ∝ |κ|^(1/2) (de Boor 1973). The first is wanted where the cube holds all, the second
where an output curve behind it magnifies the errors of the darks; few of the lines across an axis then carry the
largest errors, and a power mean of their curvatures counts these for more.

Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
reader's own interpolation has less than half of that error. Points are plentiful, so the normal equations are well
conditioned: conjugate gradients with a diagonal preconditioner take a dozen steps, and no smoothness term is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array, Mask
from lutforge.errors import CalibrationError, LutError
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate
from lutforge.luts.shaper import SHAPER_SIZE
from lutforge.model.lattice import grid, snap_levels
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.robust_weights import lawson

Function = Callable[[Array], Array]

LINES = 64
"""Lines along each axis on which slope and curvature are measured, beside the grey axis, and steps of each."""
STEPS = 256


@dataclass(frozen=True, eq=False)
class Axes:
    """The axes of a cube.

    levels: of the input, on the shaper's grid. curve: (m, 3), increasing from 0 to 1, or none: the cube is linear in
    its values between two nodes.
    """

    curve: Array | None
    levels: Levels

    def stretched(self, x: Array) -> Array:
        """Map inputs (…, 3) through the curve, which continues with slope 1 beyond 1."""
        return x if self.curve is None else apply_curve(self.curve, x) + np.maximum(x - 1.0, 0.0)


def fit_axes(
    function: Function,
    gain: Array,
    size: int,
    weight: Function | None = None,
    curve: Array | None = None,
    stops: float = 0.0,
) -> Axes:
    """Curve and `size` node levels per axis for a function (n, 3) in [0, 1] → (n, 3), which is measured along lines.

    gain: (3,) in front of it, where it clamps at 1: inputs are taken to be even before it. weight: outputs (n, 3) →
    (n,), how much a squared error counts there. curve: the input curve, where it is known. stops: of light that the
    axes span beyond 1; the more, the finer the darks are looked at.
    """
    t = np.linspace(0.0, 1.0, STEPS + 1) ** (1.5 + 0.25 * stops)  # finer in the darks, where responses are steep
    others = sobol(LINES, 2)
    others[: LINES // 2] **= 2
    lines = []  # per axis the values (LINES + 1, STEPS + 1, 3) along it; the first line is the grey axis
    for axis in range(3):
        across = [c for c in range(3) if c != axis]
        x = np.empty((LINES + 1, len(t), 3))
        x[..., axis] = t
        x[1:, :, across] = np.minimum(others * np.maximum(gain[across], 1.0), 1.0)[:, None, :]
        x[0] = t[:, None]
        lines.append(function(x.reshape(-1, 3)).reshape(x.shape))
    # The share of all inputs that each line but the grey axis stands for; half lie in the dark tones.
    density = 0.5 + 0.125 / np.sqrt(np.maximum(others.prod(axis=1), 1e-4))
    share = 1 / (density * np.sum(1 / density))
    if weight is not None:  # it looks for the largest errors
        share = np.full(LINES, 1 / LINES)
    if curve is None:
        squares = [np.sum((np.diff(y, axis=1) / np.diff(t)[:, None]) ** 2, axis=2) for y in lines]
        curve = np.stack([_curve(np.sqrt(_mean(square, share)), t) for square in squares], axis=1)
    even = np.linspace(0.0, 1.0, len(curve))
    levels = []
    for axis, values in enumerate(lines):  # between two levels there is equal mass
        mass = _mass(values, t, np.interp(t, even, curve[:, axis]), share, weight)
        total = np.concatenate([[0.0], np.cumsum(mass)])
        levels.append(snap_levels(np.interp(np.linspace(0.0, total[-1], size), total, t), SHAPER_SIZE))
    return Axes(curve if len(curve) > 2 else None, (levels[0], levels[1], levels[2]))  # a straight line changes nothing


def _mean(values: Array, share: Array, grey: float = 0.25) -> Array:
    """The mean over the lines (LINES + 1, m), of which the grey axis counts the share `grey`."""
    return np.asarray((1 - grey) * (share @ values[1:]) + grey * values[0])


def _curve(slope: Array, t: Array) -> Array:
    """The running sum of a slope, from 0 to 1, at SHAPER_SIZE even steps."""
    density = scipy.ndimage.gaussian_filter1d(slope, 4.0, mode="nearest")
    total = float(np.sum(density * np.diff(t)))
    # Half of a straight line beside the slope, so that the curve rises where the function is flat.
    density = density + 0.5 * total if total > 1e-12 else np.ones_like(density)
    u = np.concatenate([[0.0], np.cumsum(density * np.diff(t))])
    curve = scipy.interpolate.PchipInterpolator(t, u / u[-1])(np.linspace(0.0, 1.0, SHAPER_SIZE))
    curve[0], curve[-1] = 0.0, 1.0
    return np.asarray(curve)


def _mass(y: Array, t: Array, u: Array, share: Array, weight: Function | None) -> Array:
    """Share of the nodes in each step, from the curvature that is left along u."""
    step, wide = np.diff(t), np.diff(u)
    bend = np.diff(np.diff(y, axis=1) / wide[:, None], axis=1) * (2 / (wide[1:] + wide[:-1]))[:, None]
    square = np.sum(bend**2, axis=2)
    if weight is None:
        inputs = (step[1:] + step[:-1]) / (wide[1:] + wide[:-1])  # how many, per unit of u; half way, as the fit has it
        density = (_mean(np.sqrt(square), share) * np.sqrt(inputs)) ** (1 / 3)
    else:
        square *= weight(y[:, 1:-1].reshape(-1, 3)).reshape(square.shape)
        # The cubic mean of curvatures lies between the root mean square and the largest.
        density = _mean(square**1.5, share, 0.5) ** (1 / 6)
    density = scipy.ndimage.gaussian_filter1d(np.pad(density, 1, mode="edge"), 1.0, mode="nearest")
    mass = 0.5 * (density[1:] + density[:-1]) * wide
    total = mass.sum()
    mass = 0.8 * mass / total + 0.2 * step if total > 1e-12 else step  # a fifth of the nodes stays evenly spread
    return np.asarray(mass / mass.sum())


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
    `fit_axes` has it. Black and white are the function's own; the grey axis counts 30 times. weight: (n, 3) of
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
    omega[[count, -GREY_POINTS - 1]] = 1e4 * omega.mean()  # black and white: the nodes beside them know where they stay
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
