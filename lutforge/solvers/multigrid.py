"""The geometric multigrid cycle that preconditions the normal equations of lattice regression.

Coarser lattices keep every other node level; their data term is the Galerkin product P'W'WP. One symmetric V-cycle for
all three outputs at once, O(N³), in float32, as it only preconditions. Its steps are one list: those on small lattices
are gone through in one compiled call, those on large ones by planes on several threads. Kernels that call others take
long to compile, so there is one of them only. Briggs, Henson & McCormick, A
Multigrid Tutorial (2000), https://doi.org/10.1137/1.9780898719505, chapter 3.

The smoother is a Chebyshev polynomial of the fourth kind over l1-Jacobi. A polynomial in A takes only products with A,
which vectorize and run in parallel; that of the fourth kind needs no lower bound of the spectrum, and the l1 scaling
makes its upper bound 1 for every A. Two steps before and two after the coarse correction smooth as well as a symmetric
Gauss-Seidel sweep. Lottes, "Optimal polynomial smoothers for multigrid V-cycles", Numerical Linear Algebra with
Applications 30 (2023), algorithm 3 and its table of β; Baker, Falgout, Kolev & Yang, "Multigrid smoothers for
ultraparallel computing", SIAM J. Sci. Comput. 33 (2011). The coarsest lattice is solved by Cholesky factors.
"""

from enum import IntEnum
from functools import cache, partial
from typing import NamedTuple

import numpy as np

from lutforge.arrays import Array, Index, Real, Single
from lutforge.compiled import compiled
from lutforge.interpolation import Levels
from lutforge.solvers.coarsening import COARSEST, coarse_count, coarse_stencil, coarsen_axis, prolong_add, restrict
from lutforge.solvers.stencil import COUPLINGS, FAR, add_product, couple, damp, planar, run_planes, steps
from lutforge.threads import cores, run, slabs


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


@compiled(fastmath={"contract"})
def first_step(damping: Real, residual: Real, plane: int, correction: Real, b: Real, first: int, last: int) -> None:
    """Add the first correction of the polynomial to b, on planes first … last − 1.

    first is a multiple of run_planes(plane).

    residual, correction, b: (3, nodes and FAR planes on both sides).
    """
    planes, factor, optimal = run_planes(plane), np.float32(4 / 3), np.float32(1.02387287570313)
    for begin in range(first, last, planes):
        node, count = begin * plane, (min(begin + planes, last) - begin) * plane
        start = node + FAR * plane
        for c in range(3):
            scale, r = damping[c, node : node + count], residual[c, start : start + count]
            z, x = correction[c, start : start + count], b[c, start : start + count]
            for p in range(count):
                z[p] = factor * scale[p] * r[p]
                x[p] += optimal * z[p]


@compiled(fastmath={"contract"})
def second_step(damping: Real, residual: Real, plane: int, correction: Real, b: Real, first: int, last: int) -> None:
    """Add the second correction, from the residual that the first one left."""
    planes, kept, new, optimal = run_planes(plane), np.float32(1 / 5), np.float32(12 / 5), np.float32(1.26408905371085)
    for begin in range(first, last, planes):
        node, count = begin * plane, (min(begin + planes, last) - begin) * plane
        start = node + FAR * plane
        for c in range(3):
            scale, r = damping[c, node : node + count], residual[c, start : start + count]
            z, x = correction[c, start : start + count], b[c, start : start + count]
            for p in range(count):
                x[p] += optimal * (kept * z[p] + new * scale[p] * r[p])


class _Step(IntEnum):
    """A step of a V-cycle on one lattice.

    It smooths from b = 0 on (START), or from the present b (CORRECT), and once more (FINISH); forms the residual
    (SUBTRACT); goes to the next coarser lattice and comes back; on the coarsest it solves.
    """

    START = 0
    FINISH = 1
    SUBTRACT = 2
    RESTRICT = 3
    PROLONG = 4
    CORRECT = 5
    SOLVE = 6


DOWN = (_Step.START, _Step.FINISH, _Step.SUBTRACT, _Step.RESTRICT)
UP = (_Step.PROLONG, _Step.SUBTRACT, _Step.CORRECT, _Step.FINISH)


def _way(finest: int, coarsest: int) -> Index:
    """The V-cycle from a lattice on down and back: (n, 2), a lattice and a step on it."""
    down = [(level, step) for level in range(finest, coarsest) for step in DOWN]
    up = [(level, step) for level in range(coarsest - 1, finest - 1, -1) for step in UP]
    return np.array([*down, (coarsest, _Step.SOLVE), *up])


class _Hierarchy(NamedTuple):
    """The lattices of a cycle, the finest first: their operators and their vectors, each flat, one after the other.

    table: where they begin; cells, shares: (depth − 1, …), what interpolates to the next finer lattice; couplings,
    diagonal, damping: A as `stencil` has it; factors: Cholesky factors of the coarsest A, (3, m, m).
    """

    table: Index
    cells: Index
    shares: Single
    couplings: Single
    diagonal: Single
    damping: Single
    factors: Array
    right: Single
    b: Single
    residual: Single
    correction: Single


@cache
def _table(size: tuple[int, int, int]) -> Index:
    """Per lattice, finest first: N_r, N_g, N_b, and where its nodes, its planar lattices and its couplings begin."""
    rows, nodes, lattices, couplings = [], 0, 0, 0
    while True:
        r, g, b = size
        rows.append((r, g, b, nodes, lattices, couplings))
        if max(size) <= COARSEST:
            return np.array([*rows, (0, 0, 0, nodes + 3 * r * g * b, *_after(size, lattices, couplings))])
        nodes, (lattices, couplings) = nodes + 3 * r * g * b, _after(size, lattices, couplings)
        size = (coarse_count(r), coarse_count(g), coarse_count(b))


def _after(size: tuple[int, int, int], lattices: int, couplings: int) -> tuple[int, int]:
    r, g, b = size
    return lattices + 3 * (r + 2 * FAR) * g * b, couplings + COUPLINGS * (r + FAR) * g * b


@compiled()
def _nodes(flat: Single, table: Index, level: int) -> Single:
    """(3, nodes) of a lattice."""
    return flat[table[level, 3] : table[level + 1, 3]].reshape((3, -1))


@compiled()
def _planar(flat: Single, table: Index, level: int) -> Single:
    """(3, nodes and margins) of a lattice."""
    return flat[table[level, 4] : table[level + 1, 4]].reshape((3, -1))


@compiled()
def _cube(flat: Single, table: Index, level: int) -> Single:
    """(3, N_r + 2 FAR, N_g, N_b), the same."""
    r, g, b = table[level, 0], table[level, 1], table[level, 2]
    return flat[table[level, 4] : table[level + 1, 4]].reshape((3, r + 2 * FAR, g, b))


@compiled()
def _couplings(flat: Single, table: Index, level: int) -> Single:
    return flat[table[level, 5] : table[level + 1, 5]].reshape((COUPLINGS, -1))


def _build(
    lattices: _Hierarchy,
    levels: Levels,
    stencil: Array,
    smoothness: float,
    mixed: float,
    finest: Array,
    middle: Array,
) -> None:
    """Fill the hierarchy.

    finest, middle: filled with the couplings and the diagonal of the finest lattice, of which that holds the anchor.
    The right-hand sides hold the anchor, too, and are room for those of the coarser lattices.
    """
    table, cells, shares, anchor = lattices.table, lattices.cells, lattices.shares, lattices.right
    depth, longest = len(table) - 1, cells.shape[2]
    bends, slopes = np.zeros((depth, 3, longest, 3)), np.zeros((depth, 3, longest, 3))
    masses = np.zeros((depth, 3, longest))
    for axis in range(3):
        coarsen_axis(levels[axis], axis, cells, shares, bends, slopes, masses)
    mine, own = finest, middle
    for level in range(depth):
        r, g, b = (int(count) for count in table[level, :3])
        if level > 0:
            mine, plane = np.zeros((COUPLINGS, (r + FAR) * g * b)), g * b
            own = _planar(anchor, table, level)[:, FAR * plane : (FAR + r) * plane].astype(np.float64)
        couple(stencil, bends[level], slopes[level], masses[level], smoothness, mixed, mine, own)
        couplings, diagonal = _couplings(lattices.couplings, table, level), _nodes(lattices.diagonal, table, level)
        damp(mine, own, steps(g, b), g * b, couplings, diagonal, _nodes(lattices.damping, table, level))
        if level < depth - 1:
            coarser = (int(count) for count in table[level + 1, :3])
            stencil = coarse_stencil(stencil, cells[level], shares[level], *coarser)
            fine, coarse = _cube(anchor, table, level), _cube(anchor, table, level + 1)
            restrict(fine, cells[level], shares[level], coarse, 0, 3)
    factor(mine, own, g, b, lattices.factors)


@compiled()
def _take(lattices: _Hierarchy, way: Index, first: int, last: int) -> None:
    """Take steps of a V-cycle, (n, 2), one after the other.

    They are taken on the planes first … last − 1 of a lattice, or between it and the next coarser one on these outputs;
    on all of them where last is 0.
    """
    table = lattices.table
    for number in range(len(way)):
        level, step = way[number]
        plane = table[level, 1] * table[level, 2]
        planes, outputs = (table[level, 0], 3) if last == 0 else (last, last)
        right, b = _planar(lattices.right, table, level), _planar(lattices.b, table, level)
        residual, correction = _planar(lattices.residual, table, level), _planar(lattices.correction, table, level)
        damping = _nodes(lattices.damping, table, level)
        if step == _Step.RESTRICT:
            fine, coarse = _cube(lattices.residual, table, level), _cube(lattices.right, table, level + 1)
            restrict(fine, lattices.cells[level], lattices.shares[level], coarse, first, outputs)
        elif step == _Step.PROLONG:
            coarse, fine = _cube(lattices.b, table, level + 1), _cube(lattices.b, table, level)
            prolong_add(coarse, lattices.cells[level], lattices.shares[level], fine, first, outputs)
        elif step == _Step.SOLVE:
            solve(lattices.factors, right, b, plane)
        if step in (_Step.START, _Step.SUBTRACT):
            _begin(right, b, residual, step == _Step.START, plane, first, planes)
        if step in (_Step.SUBTRACT, _Step.FINISH):
            couplings, diagonal = _couplings(lattices.couplings, table, level), _nodes(lattices.diagonal, table, level)
            taken, far = b if step == _Step.SUBTRACT else correction, steps(table[level, 1], table[level, 2])
            add_product(np.float32(-1.0), couplings, diagonal, far, plane, taken, residual, first, planes)
        if step == _Step.FINISH:
            second_step(damping, residual, plane, correction, b, first, planes)
        elif step in (_Step.START, _Step.CORRECT):
            first_step(damping, residual, plane, correction, b, first, planes)


@compiled()
def _begin(right: Single, b: Single, residual: Single, clears: bool, plane: int, first: int, last: int) -> None:
    """residual = right on planes, and b = 0 where that is wanted.

    `to[:] = source` would take half a second to compile, for its error message.
    """
    for c in range(3):
        for p in range((first + FAR) * plane, (last + FAR) * plane):
            residual[c, p] = right[c, p]
            if clears:
                b[c, p] = 0.0


class Multigrid:
    """The operator on a lattice and on ever coarser ones, made once for every right-hand side.

    Vectors are planar, (3, nodes and margins), as `stencil` has them.
    """

    def __init__(
        self,
        levels: Levels,
        stencil: Array,
        anchor: Array,
        smoothness: float,
        mixed: float,
        *,
        small: int = 30_000,
        nodes_per_thread: int = 15_000,
    ) -> None:
        """Build the operator on the lattice and on all coarser ones.

        stencil: the data term (14, N_r, N_g, N_b), which is not changed; anchor: (N_r, N_g, N_b, 3), added to the
        diagonal; smoothness, mixed: weights of the second differences and of the mixed ones.
        small: lattices of fewer nodes are gone through in one compiled call, which rounds in its own way, however many
        threads there are; nodes_per_thread: with fewer the threads wait for each other longer than they work.
        """
        r, g, b = (len(axis) for axis in levels)
        self.size = (r, g, b)
        table = _table(self.size)
        depth, coarsest = len(table) - 1, int(np.prod(table[-2, :3]))
        nodes, lattices, couplings = (int(count) for count in table[-1, 3:])
        right = np.zeros(lattices, dtype=np.float32)
        right[: table[1, 4]] = planar(anchor).ravel()
        self._lattices = _Hierarchy(
            table,
            np.zeros((depth - 1, 3, max(self.size)), dtype=np.int64),
            np.zeros((depth - 1, 3, 2, max(self.size)), dtype=np.float32),
            np.empty(couplings, dtype=np.float32),
            np.empty(nodes, dtype=np.float32),
            np.empty(nodes, dtype=np.float32),
            np.zeros((3, coarsest, coarsest)),
            right,
            *np.zeros((3, lattices), dtype=np.float32),
        )
        diagonal = np.moveaxis(anchor, 3, 0).reshape(3, -1).copy()
        self._finest = np.zeros((COUPLINGS, (r + FAR) * g * b)), diagonal, steps(g, b), g * b
        _build(self._lattices, levels, stencil, smoothness, mixed, *self._finest[:2])
        counts = table[:-1, :3].prod(axis=1)
        self._threads: list[int] = np.clip(counts // nodes_per_thread, 1, cores()).tolist()
        self._small, deepest = int(np.argmax(counts < small)), depth - 1
        self._way = _way(0, deepest), _way(self._small, deepest)

    @property
    def threads(self) -> int:
        """The number of threads that the finest lattice is divided among."""
        return self._threads[0]

    def product(self, b: Array, out: Array) -> None:
        """out = A b; both (3, nodes and margins)."""
        out[:] = 0.0
        run(partial(add_product, 1.0, *self._finest, b, out), self._parts(0))

    def precondition(self, residual: Array) -> Single:
        """Return one symmetric V-cycle from 0 for a residual; the next call overwrites the result."""
        _planar(self._lattices.right, self._lattices.table, 0)[:] = residual
        whole, small = self._way
        threaded = len(DOWN) * self._small
        self._take_threaded(whole[:threaded])
        _take(self._lattices, small, 0, 0)
        self._take_threaded(whole[len(whole) - threaded :])
        return _planar(self._lattices.b, self._lattices.table, 0)

    def _take_threaded(self, way: Index) -> None:
        """Take steps one after the other, each on several threads."""
        for number in range(len(way)):
            level, step = way[number]
            planes, outputs = self._parts(level), slabs(0, 3, 1, self._threads[level])
            between = step in (_Step.RESTRICT, _Step.PROLONG)
            run(partial(_take, self._lattices, way[number : number + 1]), outputs if between else planes)

    def _parts(self, level: int) -> list[tuple[int, int]]:
        """The planes of a lattice, shared out between its threads."""
        r, g, b = (int(count) for count in self._lattices.table[level, :3])
        return slabs(0, r, run_planes(g * b), self._threads[level])
