"""Makes the grey axis of a lattice rise, by the smallest change of the nodes around it.

Along the axis the values of a lattice are W b. The change δ with the least norm for which no difference of W (b + δ) is
negative is a least-distance problem, which needs only the differences near those that fall. Where a channel has clipped
at white, it need not rise, but must stay clipped.
"""

import numpy as np

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import Axis, Interpolation, Levels, corner_weights, indexed, locate
from lutforge.solvers.inequality_least_squares import least_distance


def with_rising_axis(values: Array, levels: Levels, method: Interpolation) -> Array:
    """Node values (N_r, N_g, N_b, 3) whose grey axis, clamped to [0, 1], falls in no channel.

    The first and the last node stay, and none goes beyond both [0, 1] and the values that there were.
    """
    axis = _points(levels)
    nodes, weights = np.empty((len(axis), 8), dtype=np.int64), np.empty((len(axis), 8))
    _rows(axis, *indexed(levels), method == "tetrahedral", nodes, weights)
    bounds = min(0.0, float(values.min())), max(1.0, float(values.max()))
    around = 2 * len(axis) // len(levels[0])  # points of the cells next to a fall, which must not begin to fall
    changed = values.reshape(-1, 3).copy()
    for channel in range(3):
        _raise(changed[:, channel], nodes, weights, around, bounds)
    return changed.reshape(values.shape)


def _points(levels: Levels) -> Array:
    """Return where the axis is looked at: evenly, and at its kinks, where it enters a cell or another tetrahedron."""
    knots = np.unique(np.concatenate(levels))
    low, high = knots[:-1], knots[1:]
    ends = []
    for nodes in levels:
        cell = np.searchsorted(nodes, low, side="right") - 1
        ends.append([(at - nodes[cell]) / (nodes[cell + 1] - nodes[cell]) for at in (low, high)])
    fractions = np.array(ends)
    apart = fractions - np.roll(fractions, 1, axis=0)
    crossing = apart[:, 0] * apart[:, 1] < 0.0
    share = apart[:, 0] / np.where(crossing, apart[:, 0] - apart[:, 1], 1.0)
    kinks = (low + share * (high - low))[crossing]
    inside = low + (np.arange(4)[:, None] + 0.5) / 4 * (high - low)  # cubic there, if trilinear
    return np.unique(np.concatenate([np.linspace(0.0, 1.0, 1025), knots, kinks, inside.ravel()]))


def _raise(values: Array, nodes: Index, weights: Array, around: int, bounds: tuple[float, float]) -> None:
    """Change the values (N³,) of a channel in place; not at all where no change within bounds makes them rise."""
    as_given, rise = values.copy(), 1e-7  # between two points, so that rounding does not make a fall of it
    kept = np.zeros(len(nodes), dtype=np.bool_)
    for _ in range(8):
        grey = np.sum(weights * values[nodes], axis=1)
        clipped = np.maximum.accumulate(grey >= 1.0)
        lacking = np.where(clipped, 1.0 - grey, rise - np.diff(grey, prepend=-np.inf))
        falls = np.flatnonzero(lacking > np.where(clipped, 0.0, rise))
        if not len(falls):
            return
        for fall in falls:
            kept[max(fall - around, 1) : fall + around + 1] = True
        rows = np.flatnonzero(kept)
        free = np.setdiff1d(np.concatenate([nodes[rows], nodes[rows - 1]]), [0, len(values) - 1])
        place = np.full(len(values), len(free))
        place[free] = np.arange(len(free))
        change = np.zeros((len(rows), len(free) + 1))  # the last column: nodes that stay
        number = np.arange(len(rows))[:, None]
        np.add.at(change, (number, place[nodes[rows]]), weights[rows])
        before = np.where(clipped[rows], 0.0, 1.0)[:, None]
        np.add.at(change, (number, place[nodes[rows - 1]]), -before * weights[rows - 1])
        moved = least_distance(change[:, :-1], lacking[rows])
        if not moved.converged:  # the nodes that stay forbid it
            break
        values[free] = np.clip(values[free] + moved.value, *bounds)
    values[:] = as_given


@compiled()
def _rows(
    axis: Array, r_axis: Axis, g_axis: Axis, b_axis: Axis, tetrahedral: bool, nodes: Index, weights: Array
) -> None:
    """Fill the nodes around each point of the axis (n, 8), and their weights (n, 8)."""
    ng, nb = len(g_axis.levels), len(b_axis.levels)
    for n in range(len(axis)):
        i, fr = locate(r_axis, axis[n])
        j, fg = locate(g_axis, axis[n])
        k, fb = locate(b_axis, axis[n])
        corner_weights(tetrahedral, fr, fg, fb, weights[n])
        for p in range(8):
            nodes[n, p] = ((i + (p >> 2)) * ng + j + ((p >> 1) & 1)) * nb + k + (p & 1)
