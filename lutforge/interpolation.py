"""Trilinear and tetrahedral interpolation of a lattice on nonuniform axes, and linear interpolation of a curve.

The weights are those of the readers of LUT files (OpenColorIO's `ops/lut3d`): trilinear over the eight corners of the
cell, or tetrahedral over four of them, walked from the low corner to the high one along the axes in falling order of
the fractional coordinate. Inputs outside the first and last node level are clamped, as LUT readers do.
"""

from typing import Literal, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.threads import run, shares

Interpolation = Literal["trilinear", "tetrahedral"]
INTERPOLATIONS: tuple[Interpolation, ...] = get_args(Interpolation)

Levels = tuple[Array, Array, Array]
"""The node levels of the three axes, each (N,) strictly increasing."""

POINTS_PER_THREAD = 20_000


class Axis(NamedTuple):
    """An axis of a lattice, indexed so that the cell of a number is found at once, however uneven the levels are.

    levels: (N,) strictly increasing; guide: the cell at which the search begins in each of even steps of the axis
    (Chen & Asau 1974, https://doi.org/10.1080/05695557408974949); per_level: steps in a unit of the levels.
    """

    levels: Array
    guide: Index
    per_level: float


def indexed(levels: Levels) -> tuple[Axis, Axis, Axis]:
    """The axes of a lattice as `locate` takes them, with 16 steps a node, so that few of them hold a level."""
    r, g, b = (Axis(axis, *_guide(np.ascontiguousarray(axis), 16 * len(axis))) for axis in levels)
    return r, g, b


@compiled()
def _guide(levels: Array, steps: int) -> tuple[Index, float]:
    """The last cell that begins in an earlier step than each one (steps + 1,), and steps in a unit of the levels."""
    last = len(levels) - 1
    guide, per_level, step = np.full(steps + 1, last - 1), steps / (levels[last] - levels[0]), 0
    for i in range(last):
        until = min(int((levels[i] - levels[0]) * per_level), steps)
        guide[step : until + 1] = max(i - 1, 0)
        step = max(step, until + 1)
    return guide, per_level


@compiled()
def locate(axis: Axis, x: float) -> tuple[int, float]:
    """Cell index (0 … N − 2) and fraction in [0, 1] of `x` on one axis; `x` is clamped, and NaN to the first node."""
    levels, last = axis.levels, len(axis.levels) - 1
    x = min(x, levels[last]) if x > levels[0] else levels[0]
    i = axis.guide[int((x - levels[0]) * axis.per_level)]
    while i < last - 1 and levels[i + 1] <= x:
        i += 1
    return i, (x - levels[i]) / (levels[i + 1] - levels[i])


@compiled()
def corner_weights(tetrahedral: bool, fr: float, fg: float, fb: float, weights: Array) -> None:
    """Fill `weights` (8,) with the weights of a cell's corners; corner index = 4·r + 2·g + b with r, g, b in {0, 1}."""
    if not tetrahedral:
        weights[0] = (1 - fr) * (1 - fg) * (1 - fb)
        weights[1] = (1 - fr) * (1 - fg) * fb
        weights[2] = (1 - fr) * fg * (1 - fb)
        weights[3] = (1 - fr) * fg * fb
        weights[4] = fr * (1 - fg) * (1 - fb)
        weights[5] = fr * (1 - fg) * fb
        weights[6] = fr * fg * (1 - fb)
        weights[7] = fr * fg * fb
        return
    weights[:] = 0.0
    # Sort the axes by fraction, largest first: (fraction, corner step).
    f0, s0, f1, s1, f2, s2 = fr, 4, fg, 2, fb, 1
    if f0 < f1:
        f0, s0, f1, s1 = f1, s1, f0, s0
    if f1 < f2:
        f1, s1, f2, s2 = f2, s2, f1, s1
    if f0 < f1:
        f0, s0, f1, s1 = f1, s1, f0, s0
    weights[0] = 1 - f0
    weights[s0] = f0 - f1
    weights[s0 + s1] = f1 - f2
    weights[7] += f2


@compiled()
def _interpolate(
    x: Array,
    r_axis: Axis,
    g_axis: Axis,
    b_axis: Axis,
    values: Array,
    tetrahedral: bool,
    y: Array,
    first: int,
    last: int,
) -> None:
    weights = np.empty(8)
    for n in range(first, last):
        ir, fr = locate(r_axis, x[n, 0])
        ig, fg = locate(g_axis, x[n, 1])
        ib, fb = locate(b_axis, x[n, 2])
        corner_weights(tetrahedral, fr, fg, fb, weights)
        for c in range(values.shape[3]):
            total = 0.0
            for corner in range(8):
                w = weights[corner]
                if w != 0.0:
                    total += w * values[ir + (corner >> 2), ig + ((corner >> 1) & 1), ib + (corner & 1), c]
            y[n, c] = total


def interpolate(x: ArrayLike, levels: Levels, values: Array, method: Interpolation = "trilinear") -> Array:
    """Evaluate a lattice at `x`.

    x: (…, 3); levels: three (N,) axes; values: (N_r, N_g, N_b, C). Returns (…, C), float64.
    Inputs outside the axes are clamped. Time O(n), multi-threaded.
    """
    points = np.asarray(x, dtype=np.float64)
    flat = np.ascontiguousarray(points.reshape(-1, 3))
    nodes = np.ascontiguousarray(values, dtype=np.float64)
    axes = indexed(levels)
    tetrahedral = method == "tetrahedral"
    result = np.empty((len(flat), nodes.shape[3]))
    run(
        lambda first, last: _interpolate(flat, *axes, nodes, tetrahedral, result, first, last),
        shares(len(flat), POINTS_PER_THREAD),
    )
    return result.reshape(*points.shape[:-1], nodes.shape[3])


def apply_curve(table: Array, x: Array) -> Array:
    """Evaluate a curve per channel at x (…, 3), which is clamped to [0, 1]; NaN counts as 0.

    table: (m, 3), the values of the curves at m even steps from 0 to 1.
    """
    curve = np.ascontiguousarray(table)
    points = np.ascontiguousarray(x).reshape(-1, 3)
    result = np.empty_like(points)
    run(lambda first, last: _through(curve, points, result, first, last), shares(len(points), POINTS_PER_THREAD))
    return result.reshape(x.shape)


@compiled()
def _through(table: Array, x: Array, y: Array, first: int, last: int) -> None:
    end = table.shape[0] - 1
    for n in range(first, last):
        for c in range(3):
            at = x[n, c] * end
            if not at > 0:
                y[n, c] = table[0, c]
            elif at >= end:
                y[n, c] = table[end, c]
            else:
                i = int(at)
                y[n, c] = table[i, c] + (at - i) * (table[i + 1, c] - table[i, c])
