"""Fit the nodes of a cube to a known function by weighted least squares.

Sampling a function at the nodes makes every cell err to the same side of a curve; the least-squares cube under the
reader's own interpolation has less than half of that error.
Points are plentiful, so the normal equations are well conditioned: conjugate gradients with a diagonal preconditioner
take a dozen steps, and no smoothness term is needed.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.errors import CalibrationError, LutError
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate
from lutforge.model.lattice import grid
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.robust_weights import lawson

Function = Callable[[Array], Array]

GREY_POINTS = 1025
"""Points of the grey axis, beside those of the whole cube."""


@dataclass(frozen=True, eq=False)
class Samples:
    """A function at the points of a fit.

    x, y: (n, 3), points even over the cells of each of `designs` in turn, and then GREY_POINTS of the grey axis.

    on_face: (points, 3), which coordinates were beyond an end of their axis and clamped to it; counted: (points,), the
    weight that corrects for how many inputs really lie there. nodes: per design (N, N, N, 3), the values at its nodes.
    """

    x: Array
    y: Array
    designs: tuple[Levels, ...]
    on_face: Mask
    counted: Array
    nodes: tuple[Array, ...]

    def behind(self, curve: Array) -> "Samples":
        """Return the samples with a curve behind the function."""
        return replace(self, y=apply_curve(curve, self.y), nodes=tuple(apply_curve(curve, y) for y in self.nodes))

    def of_design(self, design: int) -> tuple[Array, Array, Array]:
        """Return x, y (m, 3) and weights (m,) for a fit at one of the designs: the points, its nodes, the grey axis.

        A weight is the geometric mean of every input and every cell counting alike, by the density of the points (the
        balance heuristic of Veach and Guibas 1995).
        """
        levels = self.designs[design]
        density = np.mean([1 / self._cells(known) for known in self.designs], axis=0)
        share = self.counted / (np.sqrt(self._cells(levels)) * density)
        widths = [np.gradient(axis) * (len(axis) - 1) for axis in levels]
        at_nodes = np.sqrt(np.einsum("i,j,k->ijk", *widths)).ravel()
        count = len(share)
        # A node counts half of a point: more, and the fit comes near to sampling.
        return (
            np.concatenate([self.x[:count], grid(levels).reshape(-1, 3), self.x[count:]]),
            np.concatenate([self.y[:count], self.nodes[design].reshape(-1, 3), self.y[count:]]),
            np.concatenate([share / share.mean(), 0.5 * at_nodes / at_nodes.mean(), np.ones(GREY_POINTS)]),
        )

    def _cells(self, levels: Levels) -> Array:
        """The size of the cell that each of the points is in, (points,), 1 where cells are even."""
        size = np.ones(len(self.counted))
        for c, axis in enumerate(levels):
            widths = np.diff(axis) * (len(axis) - 1)
            cell = np.searchsorted(axis[1:-1], self.x[: len(size), c], side="right")
            size *= np.where(self.on_face[:, c], 1.0, widths[cell])
        return size


def sample(
    function: Function,
    designs: tuple[Levels, ...],
    gain: Array,
    progress: Callable[[float], None] = lambda share: None,
) -> Samples:
    """Evaluate a function (n, 3) in [0, 1] → (n, 3) for fits at each of `designs`, of the same size.

    gain: in front of it, as `measure_lines` has it. progress: called with the share of the points that is done.
    """
    spread, on_face, counted = _points(designs, gain)
    grey = np.repeat(np.linspace(0.0, 1.0, GREY_POINTS)[:, None], 3, axis=1)
    nodes = [grid(levels) for levels in designs]
    x = np.concatenate([spread, grey, *(at.reshape(-1, 3) for at in nodes)])
    y = np.empty_like(x)
    for start in range(0, len(x), 1 << 16):
        progress(start / len(x))
        part = slice(start, start + (1 << 16))
        y[part] = function(x[part])
    count = len(spread) + GREY_POINTS
    values = tuple(part.reshape(nodes[0].shape) for part in np.split(y[count:], len(designs)))
    return Samples(x[:count], y[:count], designs, on_face, counted, values)


def fit_cube(
    samples: Samples,
    design: int,
    knots: Levels,
    method: Interpolation,
    curve: Function | None = None,
    weight: Function | None = None,
    limit: bool = True,
) -> Array:
    """Node values (N, N, N, 3) at one of the designs that come nearest to the samples under the given interpolation.

    knots: the design's levels on the axes of the cube, to which `curve` takes inputs. Black and white are the
    function's own; the grey axis counts 30 times. weight: (n, 3) of outputs → (n,), how much a squared error
    counts there, as an output curve behind the cube magnifies it; then a second, reweighted fit (Lawson 1961) brings
    down the largest errors. limit: no node leaves the function's own range, whatever would fit best, so that a
    file keeps within the legal range.
    """
    x, y, omega = samples.of_design(design)
    nodes = samples.nodes[design]
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


def _points(designs: tuple[Levels, ...], gain: Array) -> tuple[Array, Mask, Array]:
    """Points (n, 3), even over the cells of each design, some of them on its faces: `on_face` and `counted` of Samples.

    Where a gain clips its inputs, many of them fall on the upper face.
    """
    overhang = 0.03  # share of the points beyond either end of an axis, clamped to its face
    size = len(designs[0][0])
    cells = (size - 1) ** 3
    # Four points a cell; above half a million one for each is enough beside its node.
    count = max(1 << 16, min(4 * cells, max(1 << 19, cells)))
    u = sobol(count)
    even = np.linspace(0.0, 1.0, size)
    counted = np.ones(count)
    on_face = np.empty(u.shape, dtype=np.bool_)
    x = np.empty_like(u)
    for c in range(3):
        beyond = max(1.0 - 1.0 / float(gain[c]), 0.0)
        above = max(overhang, 0.25 * beyond**0.5)
        place = u[:, c] * (1 + overhang + above) - overhang
        upper = max(beyond, overhang) / above / (1.0 - beyond)
        counted *= np.where(place > 1, np.sqrt(upper), 1.0)
        on_face[:, c] = (place > 1) | (place < 0)
        for number, design in enumerate(designs):  # in turn: any stretch of a Sobol sequence is even
            part = slice(number * count // len(designs), (number + 1) * count // len(designs))
            x[part, c] = np.interp(np.clip(place[part], 0.0, 1.0), even, design[c])
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
