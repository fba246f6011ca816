"""The data term of lattice regression, W'W and W'y, assembled as a stencil (thesis 5.2; Garcia & Gupta 2009).

A sample touches the eight corners of one cell, so W'W couples a node with its 26 neighbours at most. It is symmetric:
kept are its diagonal and the couplings with the 13 neighbours that follow, without ever forming W. Samples are sorted
by cell, and what a cell's samples make of its 8 corners is summed before it goes into the stencil. Time O(36 n), memory
O(14 N³). The sums of a node come in one order whatever the number of threads.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import Axis, Interpolation, Levels, corner_weights, indexed, locate
from lutforge.threads import cores, run, slabs

FOLLOWING = 14
"""Offsets of a node's neighbours (dr, dg, db) in the order of 9 dr + 3 dg + db, from itself (0, 0, 0) to (1, 1, 1)."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """W'ΩW as half a 27-point stencil and W'Ωy, for sample weights Ω.

    stencil: (FOLLOWING, N_r, N_g, N_b), 0 where there is no such neighbour; right: (N_r, N_g, N_b, 3).
    """

    stencil: Array
    right: Array

    def __add__(self, other: "NormalEquations") -> "NormalEquations":
        """Return the equations of the samples of both."""
        return NormalEquations(self.stencil + other.stencil, self.right + other.right)


@compiled()
def _locate(
    x: Array, r_axis: Axis, g_axis: Axis, b_axis: Axis, cell: Index, fraction: Array, first: int, last: int
) -> None:
    """The cell of each sample of a range, (N_g − 1)(N_b − 1) i + (N_b − 1) j + k, and the fractions in it."""
    ng, nb = len(g_axis.levels) - 1, len(b_axis.levels) - 1
    for n in range(first, last):
        ir, fraction[n, 0] = locate(r_axis, x[n, 0])
        ig, fraction[n, 1] = locate(g_axis, x[n, 1])
        ib, fraction[n, 2] = locate(b_axis, x[n, 2])
        cell[n] = (ir * ng + ig) * nb + ib


@compiled()
def _sort(cell: Index, order: Index, begin: Index) -> None:
    """Fill samples in order of their cells (n,), and where each cell begins (cells + 1,), 0 before: a counting sort."""
    for n in range(len(cell)):
        begin[cell[n]] += 1
    for c in range(1, len(begin)):
        begin[c] += begin[c - 1]
    for n in range(len(cell) - 1, -1, -1):  # from behind, as each cell is filled from its end
        begin[cell[n]] -= 1
        order[begin[cell[n]]] = n


@compiled()
def _assemble(
    order: Index,
    begin: Index,
    fraction: Array,
    y: Array,
    weight: Array,
    tetrahedral: bool,
    stencil: Array,
    right: Array,
    first: int,
    last: int,
) -> None:
    """Add the samples of the slabs of cells first, first + 2, … < last along the first axis: they share no node."""
    ng, nb = stencil.shape[2] - 1, stencil.shape[3] - 1
    weights = np.empty(8)
    block, target = np.empty((8, 8)), np.empty((8, 3))
    for i in range(first, last, 2):
        for j in range(ng):
            for k in range(nb):
                c = (i * ng + j) * nb + k
                if begin[c] == begin[c + 1]:
                    continue
                block[:] = 0.0
                target[:] = 0.0
                for s in range(begin[c], begin[c + 1]):
                    n = order[s]
                    corner_weights(tetrahedral, fraction[n, 0], fraction[n, 1], fraction[n, 2], weights)
                    for p in range(8):
                        wp = weights[p] * weight[n]
                        for channel in range(3):
                            target[p, channel] += wp * y[n, channel]
                        for q in range(p, 8):
                            block[p, q] += wp * weights[q]
                for p in range(8):
                    pr, pg, pb = p >> 2, (p >> 1) & 1, p & 1
                    for channel in range(3):
                        right[i + pr, j + pg, k + pb, channel] += target[p, channel]
                    for q in range(p, 8):
                        offset = 9 * ((q >> 2) - pr) + 3 * (((q >> 1) & 1) - pg) + (q & 1) - pb
                        stencil[offset, i + pr, j + pg, k + pb] += block[p, q]


@compiled()
def _values(
    order: Index, begin: Index, fraction: Array, tetrahedral: bool, values: Array, y: Array, first: int, last: int
) -> None:
    """y = W b of the samples of the slabs of cells first … last − 1 along the first axis."""
    ng, nb = values.shape[1] - 1, values.shape[2] - 1
    weights, corners = np.empty(8), np.empty((8, 3))
    for i in range(first, last):
        for j in range(ng):
            for k in range(nb):
                c = (i * ng + j) * nb + k
                if begin[c] == begin[c + 1]:
                    continue
                for p in range(8):
                    for channel in range(3):
                        corners[p, channel] = values[i + (p >> 2), j + ((p >> 1) & 1), k + (p & 1), channel]
                for s in range(begin[c], begin[c + 1]):
                    n = order[s]
                    corner_weights(tetrahedral, fraction[n, 0], fraction[n, 1], fraction[n, 2], weights)
                    for channel in range(3):
                        total = 0.0
                        for p in range(8):
                            total += weights[p] * corners[p, channel]
                        y[n, channel] = total


class InterpolationMatrix:
    """W of samples x (n, 3) at given node levels: the cells that the samples are in, and their fractions there."""

    def __init__(self, x: Array, levels: Levels, method: Interpolation) -> None:
        self.levels = levels
        self.size = tuple(len(axis) for axis in levels)
        self._tetrahedral = method == "tetrahedral"
        count = len(x)
        self._threads = max(1, min(cores(), count // 20_000))
        x = np.ascontiguousarray(x, dtype=np.float64)
        cell, fraction, axes = np.empty(count, dtype=np.int64), np.empty((count, 3)), indexed(levels)
        run(lambda first, last: _locate(x, *axes, cell, fraction, first, last), slabs(0, count, 1, self._threads))
        r, g, b = self.size
        order, begin = np.empty(count, dtype=np.int64), np.zeros((r - 1) * (g - 1) * (b - 1) + 1, dtype=np.int64)
        _sort(cell, order, begin)
        self._rows = order, begin, fraction

    def __matmul__(self, values: Array) -> Array:
        """W b of node values (N_r, N_g, N_b, 3): (n, 3)."""
        y, values = np.empty((len(self._rows[0]), 3)), np.ascontiguousarray(values, dtype=np.float64)
        run(
            lambda first, last: _values(*self._rows, self._tetrahedral, values, y, first, last),
            slabs(0, self.size[0] - 1, 1, self._threads),
        )
        return y

    def normal_equations(self, y: Array, weight: Array | None = None) -> NormalEquations:
        """W'ΩW and W'Ωy of values y (n, 3) with weights (n,), all 1 unless given."""
        stencil, right = np.zeros((FOLLOWING, *self.size)), np.zeros((*self.size, 3))
        omega = np.ones(len(y)) if weight is None else np.ascontiguousarray(weight, dtype=np.float64)
        y = np.ascontiguousarray(y, dtype=np.float64)

        def assemble(first: int, last: int) -> None:
            _assemble(*self._rows, y, omega, self._tetrahedral, stencil, right, first, last)

        for parity in range(2):
            run(assemble, slabs(parity, self.size[0] - 1, 2, self._threads))
        return NormalEquations(stencil, right)


def normal_equations(
    x: Array, y: Array, levels: Levels, method: Interpolation, weight: Array | None = None
) -> NormalEquations:
    """Assemble W'ΩW and W'Ωy for samples `x` (n, 3) → `y` (n, 3) with weights (n,), all 1 unless given."""
    return InterpolationMatrix(x, levels, method).normal_equations(y, weight)
