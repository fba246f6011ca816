"""Transfer from a lattice to one of every other node level, and back.

Linear interpolation P along each axis, its transpose, and the operators that they make of fine ones, P'AP (Galerkin).
The trilinear functions nest.
"""

import numpy as np

from lutforge.arrays import Array, Index, Single
from lutforge.compiled import compiled
from lutforge.solvers.penalties import bending
from lutforge.solvers.stencil import FAR

COARSEST = 3
"""Axes of this many nodes or fewer are not coarsened; the coarsest lattice is solved densely."""


@compiled()
def coarse_count(count: int) -> int:
    """Nodes that the next coarser axis keeps: every other one, and the last."""
    return count if count <= COARSEST else count // 2 + 1


@compiled()
def interpolation(levels: Array, coarse: Array, cell: Index, share: Single) -> None:
    """Fill the coarse levels, and per fine node the coarse cell, (N or more,), and the shares of its two ends."""
    count, kept = len(levels), len(coarse)
    for node in range(kept):
        coarse[node] = levels[node if kept == count else min(2 * node, count - 1)]
    for node in range(count):
        at = min(node if kept == count else node // 2, kept - 2)
        cell[node] = at
        behind = (levels[node] - coarse[at]) / (coarse[at + 1] - coarse[at])
        share[0, node], share[1, node] = 1.0 - behind, behind


@compiled()
def _projected(matrix: Array, cell: Index, share: Single, kept: int) -> Array:
    """P'MP of a banded matrix (N, N) of one axis."""
    count = len(matrix)
    coarse = np.zeros((kept, kept))
    for row in range(count):
        for column in range(max(0, row - 2), min(count, row + 3)):
            for p in range(2):
                for q in range(2):
                    w = np.float64(share[p, row]) * share[q, column]
                    if w != 0.0:
                        coarse[cell[row] + p, cell[column] + q] += w * matrix[row, column]
    return coarse


@compiled()
def coarsen_axis(
    levels: Array, axis: int, cells: Index, shares: Single, bends: Array, slopes: Array, masses: Array
) -> None:
    """Fill, for each of `depth` ever coarser versions of an axis, what it interpolates with and its penalties.

    cells: (depth − 1, 3, N); shares: (depth − 1, 3, 2, N); bends, slopes: (depth, 3, N, 3) and masses: (depth, 3, N),
    as `stencil.couple` takes them.
    """
    count, depth = len(levels), len(masses)
    bend, slope, mass = bending(levels), np.zeros((count, count)), np.ones(count)
    for node in range(count - 1):
        slope[node, node] += 1.0
        slope[node + 1, node + 1] += 1.0
        slope[node, node + 1] -= 1.0
        slope[node + 1, node] -= 1.0
    for level in range(depth):
        for node in range(count):
            masses[level, axis, node] = mass[node]
            for offset in range(3):
                if node + offset < count:
                    bends[level, axis, node, offset] = bend[node, node + offset]
                if 0 <= node + offset - 1 < count:
                    slopes[level, axis, node, offset] = slope[node, node + offset - 1]
        if level == depth - 1:
            break
        kept = coarse_count(count)
        coarse, cell, share = np.empty(kept), cells[level, axis], shares[level, axis]
        interpolation(levels, coarse, cell, share)
        bend, slope = _projected(bend, cell, share, kept), _projected(slope, cell, share, kept)
        # What is diagonal stays so: the row sums of P'MP, which are at least as stiff as P'MP itself.
        lumped = np.zeros(kept)
        for node in range(count):
            lumped[cell[node]] += share[0, node] * mass[node]
            lumped[cell[node] + 1] += share[1, node] * mass[node]
        levels, mass, count = coarse, lumped, kept


@compiled(fastmath={"contract"})
def _galerkin(fine: Array, cell: Index, share: Single, coarse: Array) -> None:
    """Add P'AP of one axis, from fine (a, 3, b, N, c) to coarse (a, 3, b, N_coarse, c), the offset along it second.

    Only the later half of the offsets along it and the axes before, a, is there: A is symmetric.
    """
    count, long, half = fine.shape[3], fine.shape[4] > 1, fine.shape[0] // 2
    for a in range(half, fine.shape[0]):
        for d in range(3):
            for i in range(max(0, 1 - d), min(count, count + 1 - d)):
                other = i + d - 1
                for p in range(2):
                    row = cell[i] + p
                    for q in range(2):
                        w = np.float64(share[p, i]) * share[q, other]
                        offset = cell[other] + q - row + 1
                        if w == 0.0 or (half == 0 and offset == 0):
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


@compiled()
def coarse_stencil(half: Array, cells: Index, shares: Single, kr: int, kg: int, kb: int) -> Array:
    """P'AP of a 27-point stencil A, (14, N_r, N_g, N_b), one axis after the other; one of (14, kr, kg, kb) again.

    cells, shares: (3, N or more) and (3, 2, N or more) of the axes.
    """
    nr, ng, nb = half.shape[1:]
    full = np.zeros((27, nr, ng, nb))
    for t in range(14):
        dr, dg, db = (t + 13) // 9 - 1, (t + 13) // 3 % 3 - 1, (t + 13) % 3 - 1
        step = (dr * ng + dg) * nb + db
        source, ahead, behind = half[t].reshape(-1), full[13 + t].reshape(-1), full[13 - t].reshape(-1)
        for p in range(len(source)):
            ahead[p] = source[p]
        for p in range(len(source) - step):
            behind[p + step] = source[p]
    one = np.zeros((1, 3, 9, kr, ng * nb))
    _galerkin(full.reshape((1, 3, 9, nr, ng * nb)), cells[0], shares[0], one)
    two = np.zeros((3, 3, 3 * kr, kg, nb))
    _galerkin(one.reshape((3, 3, 3 * kr, ng, nb)), cells[1], shares[1], two)
    three = np.zeros((9, 3, kr * kg, kb, 1))
    _galerkin(two.reshape((9, 3, kr * kg, nb, 1)), cells[2], shares[2], three)
    return three.reshape((27, kr, kg, kb))[13:].copy()


@compiled(fastmath={"contract"})
def restrict(fine: Single, cells: Index, shares: Single, coarse: Single, first: int, last: int) -> None:
    """coarse = P' fine of the outputs first … last − 1, one axis after the other.

    fine, coarse: (3, N_r + 2 FAR, N_g, N_b), planes of zeros on both sides.
    """
    nr, ng, nb = fine.shape[1:]
    kr, kg = coarse.shape[1:3]
    planes = np.empty((kr - 2 * FAR, ng * nb), dtype=fine.dtype)
    lines = np.empty((kr - 2 * FAR, kg, nb), dtype=fine.dtype)
    for c in range(first, last):
        planes[:] = 0
        for i in range(nr - 2 * FAR):
            source = fine[c, FAR + i].reshape(-1)
            for r in range(2):
                w = shares[0, r, i]
                if w != 0:
                    to = planes[cells[0, i] + r]
                    for p in range(len(source)):
                        to[p] += w * source[p]
        lines[:] = 0
        for i in range(kr - 2 * FAR):
            for j in range(ng):
                line = planes[i, j * nb : (j + 1) * nb]
                for g in range(2):
                    w = shares[1, g, j]
                    if w != 0:
                        to = lines[i, cells[1, j] + g]
                        for k in range(nb):
                            to[k] += w * line[k]
            for j in range(kg):
                line, to = lines[i, j], coarse[c, FAR + i, j]
                to[:] = 0
                for k in range(nb):
                    at = cells[2, k]
                    to[at] += shares[2, 0, k] * line[k]
                    to[at + 1] += shares[2, 1, k] * line[k]


@compiled(fastmath={"contract"})
def prolong_add(coarse: Single, cells: Index, shares: Single, fine: Single, first: int, last: int) -> None:
    """fine += P coarse of the same."""
    nr, ng, nb = fine.shape[1:]
    kr, kg = coarse.shape[1:3]
    lines, planes = np.empty((kg, nb), dtype=fine.dtype), np.empty((kr - 2 * FAR, ng * nb), dtype=fine.dtype)
    for c in range(first, last):
        for i in range(kr - 2 * FAR):
            for j in range(kg):
                line = coarse[c, FAR + i, j]
                for k in range(nb):
                    at = cells[2, k]
                    lines[j, k] = shares[2, 0, k] * line[at] + shares[2, 1, k] * line[at + 1]
            for j in range(ng):
                at, near, far = cells[1, j], shares[1, 0, j], shares[1, 1, j]
                before, after, to = lines[at], lines[at + 1], planes[i, j * nb : (j + 1) * nb]
                for k in range(nb):
                    to[k] = near * before[k] + far * after[k]
        for i in range(nr - 2 * FAR):
            at, near, far = cells[0, i], shares[0, 0, i], shares[0, 1, i]
            before, after, to = planes[at], planes[at + 1], fine[c, FAR + i].reshape(-1)
            for p in range(len(to)):
                to[p] += near * before[p] + far * after[p]
