"""The data term of lattice regression, W'W and W'y, assembled as a stencil (thesis 5.2; Garcia & Gupta 2009).

A sample touches the eight corners of one cell, so W'W couples a node with its 26 neighbours at most: it is stored as
(nodes, 27) coefficients, without ever forming W. Samples are sorted by cell, and a cell's 8 × 8 block is summed before
it goes into the stencil. Time O(64 n), memory O(27 N³).
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, corner_weights, locate
from lutforge.regression.threads import cores, run, slabs

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SAMPLES_PER_THREAD = 20_000


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """W'ΩW as a 27-point stencil and W'Ωy, for sample weights Ω.

    stencil: (N_r, N_g, N_b, 27), offset index 9·(dr + 1) + 3·(dg + 1) + (db + 1); right: (N_r, N_g, N_b, 3).
    """

    stencil: Array
    right: Array


@njit(cache=True, nogil=True)
def _locate(
    x: Array, r_levels: Array, g_levels: Array, b_levels: Array, cell: Index, fraction: Array, first: int, last: int
) -> None:
    """The cell of each sample of a range, (N_g − 1)(N_b − 1) i + (N_b − 1) j + k, and the fractions in it."""
    ng, nb = len(g_levels) - 1, len(b_levels) - 1
    for n in range(first, last):
        ir, fraction[n, 0] = locate(r_levels, x[n, 0])
        ig, fraction[n, 1] = locate(g_levels, x[n, 1])
        ib, fraction[n, 2] = locate(b_levels, x[n, 2])
        cell[n] = (ir * ng + ig) * nb + ib


@njit(cache=True, nogil=True)
def _sort(cell: Index, cells: int) -> tuple[Index, Index]:
    """Samples in order of their cells (n,), and where each cell begins (cells + 1,): a counting sort."""
    begin = np.zeros(cells + 1, dtype=np.int64)
    for n in range(len(cell)):
        begin[cell[n] + 1] += 1
    for c in range(cells):
        begin[c + 1] += begin[c]
    order, following = np.empty(len(cell), dtype=np.int64), begin[:-1].copy()
    for n in range(len(cell)):
        order[following[cell[n]]] = n
        following[cell[n]] += 1
    return order, begin


@njit(cache=True, nogil=True)
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
    ng, nb = stencil.shape[1] - 1, stencil.shape[2] - 1
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
                        for q in range(8):
                            block[p, q] += wp * weights[q]
                for p in range(8):
                    pr, pg, pb = p >> 2, (p >> 1) & 1, p & 1
                    centre = 13 - 9 * pr - 3 * pg - pb
                    for channel in range(3):
                        right[i + pr, j + pg, k + pb, channel] += target[p, channel]
                    for q in range(8):
                        offset = centre + 9 * (q >> 2) + 3 * ((q >> 1) & 1) + (q & 1)
                        stencil[i + pr, j + pg, k + pb, offset] += block[p, q]


def normal_equations(
    x: Array, y: Array, levels: Levels, method: Interpolation, weight: Array | None = None
) -> NormalEquations:
    """Assemble W'ΩW and W'Ωy for samples `x` (n, 3) → `y` (n, 3) with weights (n,), all 1 unless given."""
    size = tuple(len(axis) for axis in levels)
    stencil, right = np.zeros((*size, 27)), np.zeros((*size, 3))
    count = len(x)
    threads = max(1, min(cores(), count // SAMPLES_PER_THREAD))
    omega = np.ones(count) if weight is None else np.ascontiguousarray(weight, dtype=np.float64)
    x, y = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(y, dtype=np.float64)
    cell, fraction = np.empty(count, dtype=np.int64), np.empty((count, 3))
    run(lambda first, last: _locate(x, *levels, cell, fraction, first, last), slabs(0, count, 1, threads))
    order, begin = _sort(cell, int(np.prod([nodes - 1 for nodes in size])))

    def assemble(first: int, last: int) -> None:
        _assemble(order, begin, fraction, y, omega, method == "tetrahedral", stencil, right, first, last)

    for parity in range(2):
        run(assemble, slabs(parity, size[0] - 1, 2, threads))
    return NormalEquations(stencil, right)
