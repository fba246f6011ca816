"""The dense solve on the coarsest lattice of a multigrid cycle, by Cholesky factors of its operator."""

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.compiled import compiled
from lutforge.solvers.stencil import COUPLINGS, FAR, steps


@compiled()
def factor(couplings: Array, diagonal: Array, ng: int, nb: int, lower: Array) -> None:
    """Add the Cholesky factors L of the operator per output to `lower` (3, m, m), the inverse of their diagonals on it.

    A column is 0 where the operator is singular: its pivot is no more than a rounding error of the diagonal.
    """
    nodes, far, margin = diagonal.shape[1], steps(ng, nb), FAR * ng * nb
    for c in range(3):
        columns = lower[c]
        for p in range(nodes):
            columns[p, p] = diagonal[c, p]
            for t in range(COUPLINGS):
                if p + far[t] < nodes:
                    columns[p + far[t], p] += couplings[t, margin + p]
        for column in range(nodes):
            pivot = columns[column, column]
            for k in range(column):
                pivot -= columns[column, k] ** 2
            scale = 1.0 / np.sqrt(pivot) if pivot > 1e-13 * diagonal[c, column] else 0.0
            for row in range(column + 1, nodes):
                total = columns[row, column]
                for k in range(column):
                    total -= columns[row, k] * columns[column, k]
                columns[row, column] = total * scale
            columns[column, column] = scale


@compiled()
def solve(factors: Array, right: Single, b: Single, plane: int) -> None:
    """Solve L L' b = right, for planar lattices b and right.

    plane: the nodes in one plane of these; factors: as `factor` leaves them.
    """
    nodes, margin = factors.shape[1], FAR * plane
    x = np.empty(nodes)
    for c in range(3):
        columns = factors[c]
        for row in range(nodes):
            total = right[c, margin + row]
            for k in range(row):
                total -= columns[row, k] * x[k]
            x[row] = total * columns[row, row]
        for row in range(nodes - 1, -1, -1):
            x[row] *= columns[row, row]
            for k in range(row):
                x[k] -= columns[row, k] * x[row]
        for row in range(nodes):
            b[c, margin + row] = x[row]
