"""The data term of lattice regression, W'ΩW and W'Ωy, assembled as a sparse matrix (thesis 5.2; Garcia & Gupta 2009).

A sample touches the eight corners of one cell, so W'ΩW couples a node with its 26 neighbours at most. It is symmetric:
its diagonal and the couplings with the 13 neighbours that follow are summed, without ever forming W. Samples are sorted
by cell, and what a cell's samples make of its 8 corners is summed before it goes into the matrix. Time O(36 n), memory
O(27 N³). The sums of a node come in one order whatever the number of threads.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import sparse

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import Axis, Interpolation, Levels, corner_weights, indexed, locate
from lutforge.threads import cores, run, slabs

FOLLOWING = 14
"""A node and the neighbours after it, (dr, dg, db) in the order of 9 dr + 3 dg + db from (0, 0, 0) to (1, 1, 1)."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """W'ΩW (N³, N³), nodes in C order, and W'Ωy (N_r, N_g, N_b, 3), for sample weights Ω."""

    matrix: sparse.dia_array
    right: Array


def symmetric(size: tuple[int, int, int], half: Iterable[tuple[tuple[int, int, int], Array]]) -> sparse.dia_array:
    """Return the symmetric matrix of couplings in a lattice of `size` nodes, as its diagonals.

    half: offsets (dr, dg, db) that are 0 or follow, and what each node is coupled by with the one there,
    (N_r, N_g, N_b), 0 where there is none.
    """
    (r, g, b), diagonals = size, dict[int, Array]()
    for (dr, dg, db), couplings in half:
        step = (dr * g + dg) * b + db
        if step == 0 or np.any(couplings):
            diagonals[step] = diagonals.get(step, 0.0) + couplings.reshape(-1)
    upper = {step: line[: len(line) - step] for step, line in diagonals.items()}
    lower = {-step: line for step, line in upper.items() if step}
    return sparse.diags_array([*upper.values(), *lower.values()], offsets=[*upper, *lower], shape=(r * g * b,) * 2)


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


def normal_equations(
    x: Array, y: Array, levels: Levels, method: Interpolation, weight: Array | None = None
) -> NormalEquations:
    """Assemble W'ΩW and W'Ωy for samples `x` (n, 3) → `y` (n, 3) with weights (n,), all 1 unless given."""
    r, g, b = size = (len(levels[0]), len(levels[1]), len(levels[2]))
    count, tetrahedral = len(x), method == "tetrahedral"
    threads = max(1, min(cores(), count // 20_000))
    x, y = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(y, dtype=np.float64)
    omega = np.ones(count) if weight is None else np.ascontiguousarray(weight, dtype=np.float64)
    cell, fraction, axes = np.empty(count, dtype=np.int64), np.empty((count, 3)), indexed(levels)
    run(lambda first, last: _locate(x, *axes, cell, fraction, first, last), slabs(0, count, 1, threads))
    order, begin = np.empty(count, dtype=np.int64), np.zeros((r - 1) * (g - 1) * (b - 1) + 1, dtype=np.int64)
    _sort(cell, order, begin)
    stencil, right = np.zeros((FOLLOWING, *size)), np.zeros((*size, 3))

    def assemble(first: int, last: int) -> None:
        _assemble(order, begin, fraction, y, omega, tetrahedral, stencil, right, first, last)

    for parity in range(2):
        run(assemble, slabs(parity, r - 1, 2, threads))
    offsets = [(t // 9 - 1, t // 3 % 3 - 1, t % 3 - 1) for t in range(27)][-FOLLOWING:]
    return NormalEquations(symmetric(size, zip(offsets, stencil, strict=True)), right)
