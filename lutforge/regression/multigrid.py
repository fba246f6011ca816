"""Conjugate gradients, preconditioned by geometric multigrid, for the normal equations of lattice regression.

The system A b = y has A = W'W + Σ_axis S'S + anchors (+ K): a 27-point stencil, three pentadiagonal bands along the
axes, and a diagonal. Coarser lattices keep every other node level, so the trilinear functions nest, and their stencil
is the Galerkin product P'W'WP; one symmetric V-cycle (coloured Gauss-Seidel, planes of one colour in parallel)
preconditions the iteration for all three outputs at once. Time and memory O(N³) per iteration. Briggs, Henson &
McCormick, A Multigrid Tutorial (2000).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

from lutforge.errors import CalibrationError
from lutforge.regression.threads import cores, run, slabs

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Axes = tuple[Array, Array, Array]

NODES_PER_THREAD = 15_000
"""Below this the threads would wait for each other longer than they work."""

FASTMATH = {"contract", "reassoc"}
"""Sums of one row in any order: else each addition waits for the one before it."""

COARSEST = 3
"""Axes of this many nodes or fewer are not coarsened; the coarsest lattice is solved densely."""


@dataclass(frozen=True, eq=False)
class Level:
    """The operator on one lattice of the hierarchy.

    stencil: (N_r, N_g, N_b, 27); bands: per axis (N, 5), the smoothness penalty at offsets −2 … 2; masses: per axis
    (N,), what that axis weighs in the other axes' penalties (1 on the finest); anchor: (N_r, N_g, N_b, 3) diagonal.
    """

    stencil: Array
    bands: Axes
    masses: Axes
    anchor: Array


@dataclass(frozen=True, eq=False)
class Transfer:
    """Linear interpolation from a coarse axis to a fine one: per fine node the coarse cell and the fraction in it."""

    cells: tuple[Index, Index, Index]
    fractions: Axes


@njit(inline="always")
def _row(
    stencil: Array,
    pr: Array,
    pg: Array,
    pb: Array,
    mr: Array,
    mg: Array,
    mb: Array,
    b: Array,
    i: int,
    j: int,
    k: int,
) -> tuple[float, float, float, float]:
    """Row (i, j, k) of A without its anchor: A b for each output, and the diagonal."""
    nr, ng, nb = b.shape[0], b.shape[1], b.shape[2]
    a0, a1, a2 = 0.0, 0.0, 0.0
    weights = stencil[i, j, k]
    if 0 < i < nr - 1 and 0 < j < ng - 1 and 0 < k < nb - 1:  # loops of fixed length, which the compiler unrolls
        for di in range(3):
            for dj in range(3):
                line = b[i + di - 1, j + dj - 1]
                for dk in range(3):
                    w = weights[9 * di + 3 * dj + dk]
                    a0 += w * line[k + dk - 1, 0]
                    a1 += w * line[k + dk - 1, 1]
                    a2 += w * line[k + dk - 1, 2]
    else:
        for di in range(max(-1, -i), min(2, nr - i)):
            for dj in range(max(-1, -j), min(2, ng - j)):
                for dk in range(max(-1, -k), min(2, nb - k)):
                    w = weights[9 * di + 3 * dj + dk + 13]
                    a0 += w * b[i + di, j + dj, k + dk, 0]
                    a1 += w * b[i + di, j + dj, k + dk, 1]
                    a2 += w * b[i + di, j + dj, k + dk, 2]
    wr, wg, wb = mg[j] * mb[k], mr[i] * mb[k], mr[i] * mg[j]
    for d in range(max(-2, -i), min(3, nr - i)):
        w = wr * pr[i, d + 2]
        a0 += w * b[i + d, j, k, 0]
        a1 += w * b[i + d, j, k, 1]
        a2 += w * b[i + d, j, k, 2]
    for d in range(max(-2, -j), min(3, ng - j)):
        w = wg * pg[j, d + 2]
        a0 += w * b[i, j + d, k, 0]
        a1 += w * b[i, j + d, k, 1]
        a2 += w * b[i, j + d, k, 2]
    for d in range(max(-2, -k), min(3, nb - k)):
        w = wb * pb[k, d + 2]
        a0 += w * b[i, j, k + d, 0]
        a1 += w * b[i, j, k + d, 1]
        a2 += w * b[i, j, k + d, 2]
    return a0, a1, a2, weights[13] + wr * pr[i, 2] + wg * pg[j, 2] + wb * pb[k, 2]


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _apply(
    stencil: Array,
    pr: Array,
    pg: Array,
    pb: Array,
    mr: Array,
    mg: Array,
    mb: Array,
    anchor: Array,
    b: Array,
    out: Array,
    first: int,
    last: int,
) -> None:
    """out = A b on the planes first … last − 1."""
    for i in range(first, last):
        for j in range(b.shape[1]):
            for k in range(b.shape[2]):
                a0, a1, a2, _ = _row(stencil, pr, pg, pb, mr, mg, mb, b, i, j, k)
                out[i, j, k, 0] = a0 + anchor[i, j, k, 0] * b[i, j, k, 0]
                out[i, j, k, 1] = a1 + anchor[i, j, k, 1] * b[i, j, k, 1]
                out[i, j, k, 2] = a2 + anchor[i, j, k, 2] * b[i, j, k, 2]


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _gauss_seidel(
    stencil: Array,
    pr: Array,
    pg: Array,
    pb: Array,
    mr: Array,
    mg: Array,
    mb: Array,
    anchor: Array,
    right: Array,
    b: Array,
    backward: bool,
    first: int,
    last: int,
) -> None:
    """Sweep the planes first, first + 3, … < last in place. Planes three apart do not couple."""
    ng, nb = b.shape[1], b.shape[2]
    for i in range(first, last, 3):
        for jj in range(ng):
            j = ng - 1 - jj if backward else jj
            for kk in range(nb):
                k = nb - 1 - kk if backward else kk
                a0, a1, a2, diagonal = _row(stencil, pr, pg, pb, mr, mg, mb, b, i, j, k)
                h = anchor[i, j, k, 0]
                b[i, j, k, 0] += (right[i, j, k, 0] - a0 - h * b[i, j, k, 0]) / (diagonal + h)
                h = anchor[i, j, k, 1]
                b[i, j, k, 1] += (right[i, j, k, 1] - a1 - h * b[i, j, k, 1]) / (diagonal + h)
                h = anchor[i, j, k, 2]
                b[i, j, k, 2] += (right[i, j, k, 2] - a2 - h * b[i, j, k, 2]) / (diagonal + h)


@njit(cache=True)
def _dense(stencil: Array, pr: Array, pg: Array, pb: Array, mr: Array, mg: Array, mb: Array, anchor: Array) -> Array:
    """A as (N_r, N_g, N_b, N_r, N_g, N_b, 3), column by column."""
    nr, ng, nb, _ = anchor.shape
    columns = np.empty((nr, ng, nb, nr, ng, nb, 3))
    unit = np.zeros((nr, ng, nb, 3))
    for i in range(nr):
        for j in range(ng):
            for k in range(nb):
                unit[i, j, k] = 1.0
                _apply(stencil, pr, pg, pb, mr, mg, mb, anchor, unit, columns[i, j, k], 0, nr)
                unit[i, j, k] = 0.0
    return columns


@njit(cache=True)
def _galerkin(stencil: Array, cell: Index, fraction: Array, coarse: Array) -> None:
    """Add P'AP for the first axis: stencil (N, n, 3, m) and coarse (N_coarse, n, 3, m), offset along it third."""
    for i in range(stencil.shape[0]):
        for d in range(-1, 2):
            if not 0 <= i + d < stencil.shape[0]:
                continue
            for p in range(2):
                wp = fraction[i] if p else 1 - fraction[i]
                for q in range(2):
                    w = wp * (fraction[i + d] if q else 1 - fraction[i + d])
                    if w == 0.0:
                        continue
                    row, offset = cell[i] + p, cell[i + d] + q - cell[i] - p + 1
                    for n in range(stencil.shape[1]):
                        for m in range(stencil.shape[3]):
                            coarse[row, n, offset, m] += w * stencil[i, n, d + 1, m]


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _restrict(fine: Array, ir: Index, ig: Index, ib: Index, fr: Array, fg: Array, fb: Array, coarse: Array) -> None:
    """coarse += P' fine, whose lines are first summed along the last axis."""
    line = np.empty((coarse.shape[2], 3))
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            line[:] = 0.0
            for k in range(fine.shape[2]):
                for c in range(3):
                    line[ib[k], c] += (1 - fb[k]) * fine[i, j, k, c]
                    line[ib[k] + 1, c] += fb[k] * fine[i, j, k, c]
            for r in range(2):
                for g in range(2):
                    w = (fr[i] if r else 1 - fr[i]) * (fg[j] if g else 1 - fg[j])
                    if w != 0.0:
                        to = coarse[ir[i] + r, ig[j] + g]
                        for k in range(len(line)):
                            for c in range(3):
                                to[k, c] += w * line[k, c]


@njit(cache=True, nogil=True, fastmath=FASTMATH)
def _prolong_add(coarse: Array, ir: Index, ig: Index, ib: Index, fr: Array, fg: Array, fb: Array, fine: Array) -> None:
    """fine += P coarse, whose lines are first interpolated along the two other axes."""
    line = np.empty((coarse.shape[2], 3))
    for i in range(fine.shape[0]):
        for j in range(fine.shape[1]):
            line[:] = 0.0
            for r in range(2):
                for g in range(2):
                    w = (fr[i] if r else 1 - fr[i]) * (fg[j] if g else 1 - fg[j])
                    if w != 0.0:
                        source = coarse[ir[i] + r, ig[j] + g]
                        for k in range(len(line)):
                            for c in range(3):
                                line[k, c] += w * source[k, c]
            for k in range(fine.shape[2]):
                for c in range(3):
                    fine[i, j, k, c] += (1 - fb[k]) * line[ib[k], c] + fb[k] * line[ib[k] + 1, c]


def coarse_nodes(count: int) -> Index:
    """Which nodes of an axis the next coarser one keeps: every other one, and the last."""
    if count <= COARSEST:
        return np.arange(count)
    kept = np.arange(0, count, 2)
    return kept if kept[-1] == count - 1 else np.append(kept, count - 1)


def interpolation_matrix(levels: Array, kept: Index) -> tuple[Index, Array, Array]:
    """Cells (N,), fractions (N,) and the dense (N, N_coarse) matrix of linear interpolation from the kept nodes."""
    coarse = levels[kept]
    cell = np.clip(np.searchsorted(coarse, levels, side="right") - 1, 0, len(coarse) - 2)
    fraction = (levels - coarse[cell]) / (coarse[cell + 1] - coarse[cell])
    matrix = np.zeros((len(levels), len(kept)))
    rows = np.arange(len(levels))
    matrix[rows, cell] = 1 - fraction
    matrix[rows, cell + 1] += fraction
    return cell, fraction, matrix


@njit(cache=True)
def to_bands(matrix: Array) -> Array:
    """The five central diagonals of a symmetric (N, N) matrix as (N, 5), offsets −2 … 2."""
    count = len(matrix)
    bands = np.zeros((count, 5))
    for row in range(count):
        for column in range(max(0, row - 2), min(count, row + 3)):
            bands[row, column - row + 2] = matrix[row, column]
    return bands


def coarse_stencil(stencil: Array, transfer: Transfer) -> Array:
    """P'AP for a 27-point stencil A (N_r, N_g, N_b, 27), one axis after the other; a 27-point stencil again."""
    for axis in range(3):
        cell, fraction = transfer.cells[axis], transfer.fractions[axis]
        shape = stencil.shape[:3]
        # The axis, and the offset along it, to the front of the nodes and of the offsets.
        grid = np.moveaxis(stencil.reshape(*shape, 3, 3, 3), (axis, 3 + axis), (0, 3))
        fine = np.ascontiguousarray(grid).reshape(shape[axis], -1, 3, 9)
        coarse = np.zeros((int(cell[-1]) + 2, *fine.shape[1:]))
        _galerkin(fine, cell, fraction, coarse)
        others = grid.shape[1:3]
        stencil = np.moveaxis(coarse.reshape(len(coarse), *others, 3, 3, 3), (0, 3), (axis, 3 + axis))
        stencil = np.ascontiguousarray(stencil).reshape(*stencil.shape[:3], 27)
    return stencil


def restrict(fine: Array, transfer: Transfer) -> Array:
    """P' of a lattice (N_r, N_g, N_b, 3)."""
    r, g, b = (int(cell[-1]) + 2 for cell in transfer.cells)
    coarse = np.zeros((r, g, b, 3))
    _restrict(fine, *transfer.cells, *transfer.fractions, coarse)
    return coarse


def _threads(b: Array) -> int:
    return max(1, min(cores(), b.size // (3 * NODES_PER_THREAD)))


class Multigrid:
    """A hierarchy of levels, made once for a lattice and used for every right-hand side."""

    def __init__(self, levels: list[Level], transfers: list[Transfer]) -> None:
        self.levels = levels
        self.transfers = transfers
        self._coarsest = self._invert(len(levels) - 1)

    @staticmethod
    def _arguments(level: Level) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array]:
        (pr, pg, pb), (mr, mg, mb) = level.bands, level.masses
        return level.stencil, pr, pg, pb, mr, mg, mb, level.anchor

    def apply(self, b: Array, depth: int = 0) -> Array:
        """A b on the lattice of that depth."""
        arguments, out = self._arguments(self.levels[depth]), np.empty_like(b)
        run(lambda first, last: _apply(*arguments, b, out, first, last), slabs(0, len(b), 1, _threads(b)))
        return out

    def _sweep(self, right: Array, b: Array, depth: int, backward: bool) -> None:
        """One Gauss-Seidel sweep in place, colour by colour; the way back is the way there reversed."""
        arguments = self._arguments(self.levels[depth])
        for colour in (2, 1, 0) if backward else (0, 1, 2):
            run(
                lambda first, last: _gauss_seidel(*arguments, right, b, backward, first, last),
                slabs(colour, len(b), 3, _threads(b)),
            )

    def _invert(self, depth: int) -> Array:
        """The dense inverse per output channel of the coarsest operator, (3, m, m); pseudo-inverse where singular."""
        level = self.levels[depth]
        count = level.anchor.size // 3
        matrices = _dense(*self._arguments(level)).reshape(count, count, 3).transpose(2, 0, 1)
        alike = bool(np.all(level.anchor == level.anchor[..., :1]))
        inverses = np.linalg.pinv(matrices[:1] if alike else matrices, rcond=1e-13, hermitian=True)
        return np.asarray(np.broadcast_to(inverses, (3, count, count)), dtype=np.float64)

    def cycle(self, right: Array, depth: int = 0) -> Array:
        """One symmetric V-cycle for A b = right, from b = 0."""
        if depth == len(self.levels) - 1:
            flat = right.reshape(-1, 3)
            solved = np.einsum("cmn,nc->mc", self._coarsest, flat)
            return np.ascontiguousarray(solved.reshape(right.shape))
        b = np.zeros_like(right)
        self._sweep(right, b, depth, False)
        residual = right - self.apply(b, depth)
        transfer = self.transfers[depth]
        correction = self.cycle(restrict(residual, transfer), depth + 1)
        _prolong_add(correction, *transfer.cells, *transfer.fractions, b)
        self._sweep(right, b, depth, True)
        return b

    def solve(
        self,
        right: Array,
        start: Array,
        tolerance: float,
        extra: Callable[[Array], Array] | None = None,
        most: int = 200,
    ) -> tuple[Array, int]:
        """Solve (A + extra) b = right for the three outputs together, by preconditioned conjugate gradients.

        right, start: (N_r, N_g, N_b, 3); tolerance: relative residual per output. Returns b and the iterations used.
        Raises CalibrationError where `most` iterations do not reach the tolerance within a factor of 1000.
        """

        def operator(b: Array) -> Array:
            return self.apply(b) + extra(b) if extra else self.apply(b)

        def dot(u: Array, v: Array) -> Array:
            total: Array = np.einsum("ijkc,ijkc->c", u, v)
            return total

        b = start.copy()
        residual = right - operator(b) if np.any(b) else right.copy()
        goal = tolerance * np.sqrt(np.maximum(dot(right, right), 1e-300))
        direction = preconditioned = self.cycle(residual)
        rho = dot(residual, preconditioned)
        size = np.sqrt(dot(residual, residual))
        for iteration in range(most):
            if np.all(size <= goal):
                return b, iteration
            image = operator(direction)
            curvature = dot(direction, image)
            step = np.where(curvature > 0, rho / np.where(curvature > 0, curvature, 1.0), 0.0)
            b += step * direction
            residual -= step * image
            size = np.sqrt(dot(residual, residual))
            preconditioned = self.cycle(residual)
            rho, previous = dot(residual, preconditioned), rho
            direction = preconditioned + np.where(previous > 0, rho / np.maximum(previous, 1e-300), 0.0) * direction
        if np.any(size > 1000 * goal):
            raise CalibrationError(
                f"lattice regression: {most} iterations left a residual of {np.max(size / goal) * tolerance:.1g}; "
                "the samples cover too little of colour space for this size: use a smaller --size"
            )
        return b, most
