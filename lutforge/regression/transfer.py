"""From a lattice to one of every other node level and back: linear interpolation P along each axis, its transpose, and
the operators that they make of fine ones, P'AP (Galerkin). The trilinear functions nest.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lutforge.regression.smoothness import second_difference
from lutforge.regression.stencil import FAR

Array = NDArray[np.float64]
Index = NDArray[np.int64]

COARSEST = 3
"""Axes of this many nodes or fewer are not coarsened; the coarsest lattice is solved densely."""


@njit(cache=True, nogil=True)
def coarse_count(count: int) -> int:
    """Nodes that the next coarser axis keeps: every other one, and the last."""
    return count if count <= COARSEST else count // 2 + 1


@njit(cache=True, nogil=True)
def interpolation(levels: Array, coarse: Array, cell: Index, fraction: Array) -> None:
    """Fill the coarse levels, and per fine node the coarse cell and the fraction in it."""
    count, kept = len(levels), len(coarse)
    for node in range(kept):
        coarse[node] = levels[node if kept == count else min(2 * node, count - 1)]
    for node in range(count):
        at = min(node if kept == count else node // 2, kept - 2)
        cell[node] = at
        fraction[node] = (levels[node] - coarse[at]) / (coarse[at + 1] - coarse[at])


@njit(cache=True, nogil=True)
def _projected(matrix: Array, cell: Index, fraction: Array, kept: int) -> Array:
    """P'MP of a banded matrix (N, N) of one axis."""
    count = len(matrix)
    coarse = np.zeros((kept, kept))
    for row in range(count):
        for column in range(max(0, row - 2), min(count, row + 3)):
            for p in range(2):
                wp = fraction[row] if p else 1.0 - fraction[row]
                for q in range(2):
                    w = wp * (fraction[column] if q else 1.0 - fraction[column])
                    if w != 0.0:
                        coarse[cell[row] + p, cell[column] + q] += w * matrix[row, column]
    return coarse


@njit(cache=True, nogil=True)
def coarsen_axis(
    levels: Array, depth: int, cells: Index, fractions: Array, bends: Array, slopes: Array, masses: Array
) -> None:
    """Fill, for each of `depth` ever coarser versions of an axis, what it interpolates with and its penalties.

    cells, fractions: (depth − 1, N); bends, slopes: (depth, N, 3) and masses: (depth, N), as `stencil.couple` takes
    them.
    """
    count = len(levels)
    rows = second_difference(levels)
    bend, slope, mass = rows.T @ rows, np.zeros((count, count)), np.ones(count)
    for node in range(count - 1):
        slope[node, node] += 1.0
        slope[node + 1, node + 1] += 1.0
        slope[node, node + 1] -= 1.0
        slope[node + 1, node] -= 1.0
    for level in range(depth):
        for node in range(count):
            masses[level, node] = mass[node]
            for offset in range(3):
                if node + offset < count:
                    bends[level, node, offset] = bend[node, node + offset]
                if 0 <= node + offset - 1 < count:
                    slopes[level, node, offset] = slope[node, node + offset - 1]
        if level == depth - 1:
            break
        kept = coarse_count(count)
        coarse, cell, fraction = np.empty(kept), cells[level, :count], fractions[level, :count]
        interpolation(levels, coarse, cell, fraction)
        bend, slope = _projected(bend, cell, fraction, kept), _projected(slope, cell, fraction, kept)
        # What is diagonal stays so: the row sums of P'MP, which are at least as stiff as P'MP itself.
        lumped = np.zeros(kept)
        for node in range(count):
            lumped[cell[node]] += (1.0 - fraction[node]) * mass[node]
            lumped[cell[node] + 1] += fraction[node] * mass[node]
        levels, mass, count = coarse, lumped, kept


@njit(cache=True, nogil=True, fastmath={"contract"})
def _galerkin(fine: Array, cell: Index, fraction: Array, coarse: Array, first: int, least: int) -> None:
    """Add P'AP of one axis: fine (a, 3, b, N, c) and coarse (a, 3, b, N_coarse, c), the offset along it second; only of
    `first` ≤ a and the coarse offsets from `least` on."""
    count, long = fine.shape[3], fine.shape[4] > 1
    for a in range(first, fine.shape[0]):
        for d in range(3):
            for i in range(max(0, 1 - d), min(count, count + 1 - d)):
                other = i + d - 1
                for p in range(2):
                    wp = fraction[i] if p else 1.0 - fraction[i]
                    row = cell[i] + p
                    for q in range(2):
                        w = wp * (fraction[other] if q else 1.0 - fraction[other])
                        offset = cell[other] + q - row + 1
                        if w == 0.0 or offset < least:
                            continue
                        if long:
                            for b in range(fine.shape[2]):
                                line, to = fine[a, d, b, i], coarse[a, offset, b, row]
                                for c in range(len(line)):
                                    to[c] += w * line[c]
                        else:
                            lines, to = fine[a, d, :, i, 0], coarse[a, offset, :, row, 0]
                            for b in range(len(lines)):
                                to[b] += w * lines[b]


@njit(cache=True, nogil=True)
def coarse_stencil(half: Array, cells: Index, fractions: Array, kr: int, kg: int, kb: int) -> Array:
    """P'AP of a 27-point stencil A, (14, N_r, N_g, N_b), one axis after the other; one of (14, kr, kg, kb) again.

    cells, fractions: (3, N or more) of each axis.
    """
    nr, ng, nb = half.shape[1:]
    full = np.zeros((27, nr, ng, nb))
    full[13:] = half
    for t in range(1, 14):
        dr, dg, db = (t + 13) // 9 - 1, (t + 13) // 3 % 3 - 1, (t + 13) % 3 - 1
        step = (dr * ng + dg) * nb + db
        ahead, behind = half[t].reshape(-1), full[13 - t].reshape(-1)
        behind[step:] = ahead[: len(ahead) - step]
    one = np.zeros((1, 3, 9, kr, ng * nb))
    _galerkin(full.reshape((1, 3, 9, nr, ng * nb)), cells[0], fractions[0], one, 0, 1)
    two = np.zeros((3, 3, 3 * kr, kg, nb))
    _galerkin(one.reshape((3, 3, 3 * kr, ng, nb)), cells[1], fractions[1], two, 1, 0)
    three = np.zeros((9, 3, kr * kg, kb, 1))
    _galerkin(two.reshape((9, 3, kr * kg, nb, 1)), cells[2], fractions[2], three, 4, 0)
    return three.reshape((27, kr, kg, kb))[13:].copy()


@njit(cache=True, nogil=True, fastmath={"contract"})
def restrict(fine: Array, cells: Index, fractions: Array, coarse: Array, first: int, last: int) -> None:
    """coarse = P' fine of the outputs first … last − 1, one axis after the other.

    fine, coarse: (3, N_r + 2 FAR, N_g, N_b), planes of zeros on both sides.
    """
    nr, ng, nb = fine.shape[1:]
    kr, kg = coarse.shape[1:3]
    planes, lines = np.empty((kr - 2 * FAR, ng * nb)), np.empty((kr - 2 * FAR, kg, nb))
    for c in range(first, last):
        planes[:] = 0.0
        for i in range(nr - 2 * FAR):
            source = fine[c, FAR + i].reshape(-1)
            for r in range(2):
                w = fractions[0, i] if r else 1.0 - fractions[0, i]
                if w != 0.0:
                    to = planes[cells[0, i] + r]
                    for p in range(len(source)):
                        to[p] += w * source[p]
        lines[:] = 0.0
        for i in range(kr - 2 * FAR):
            for j in range(ng):
                line = planes[i, j * nb : (j + 1) * nb]
                for g in range(2):
                    w = fractions[1, j] if g else 1.0 - fractions[1, j]
                    if w != 0.0:
                        to = lines[i, cells[1, j] + g]
                        for k in range(nb):
                            to[k] += w * line[k]
            for j in range(kg):
                line, to = lines[i, j], coarse[c, FAR + i, j]
                to[:] = 0.0
                for k in range(nb):
                    at, w = cells[2, k], fractions[2, k]
                    to[at] += (1.0 - w) * line[k]
                    to[at + 1] += w * line[k]


@njit(cache=True, nogil=True, fastmath={"contract"})
def prolong_add(coarse: Array, cells: Index, fractions: Array, fine: Array, first: int, last: int) -> None:
    """fine += P coarse of the same."""
    nr, ng, nb = fine.shape[1:]
    kr, kg = coarse.shape[1:3]
    lines, planes = np.empty((kg, nb)), np.empty((kr - 2 * FAR, ng * nb))
    for c in range(first, last):
        for i in range(kr - 2 * FAR):
            for j in range(kg):
                line = coarse[c, FAR + i, j]
                for k in range(nb):
                    at, w = cells[2, k], fractions[2, k]
                    lines[j, k] = (1.0 - w) * line[at] + w * line[at + 1]
            for j in range(ng):
                at, w = cells[1, j], fractions[1, j]
                before, after, to = lines[at], lines[at + 1], planes[i, j * nb : (j + 1) * nb]
                for k in range(nb):
                    to[k] = (1.0 - w) * before[k] + w * after[k]
        for i in range(nr - 2 * FAR):
            at, w = cells[0, i], fractions[0, i]
            before, after, to = planes[at], planes[at + 1], fine[c, FAR + i].reshape(-1)
            for p in range(len(to)):
                to[p] += (1.0 - w) * before[p] + w * after[p]
