"""The geometric multigrid cycle that preconditions the normal equations of lattice regression.

Coarser lattices keep every other node level; their data term is the Galerkin product P'W'WP. One symmetric V-cycle for
all three outputs at once, O(N³), in float32, as it only preconditions. Small lattices are gone through in one compiled
call, large ones by planes on several threads. Briggs, Henson & McCormick, A Multigrid Tutorial (2000).
"""

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.compiled import compiled
from lutforge.interpolation import Levels
from lutforge.solvers.chebyshev import first_step, second_step
from lutforge.solvers.stencil import COUPLINGS, FAR, add_product, couple, damp, planar, run_planes, steps
from lutforge.solvers.transfer import (
    COARSEST,
    coarse_count,
    coarse_stencil,
    coarsen_axis,
    prolong_add,
    restrict,
)
from lutforge.threads import cores, run, slabs

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Real = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

NODES_PER_THREAD = 15_000
"""Below this the threads would wait for each other longer than they work."""
SMALL = 30_000
"""Lattices of fewer nodes are gone through in one compiled call, however many threads there are: it rounds in its own
way."""
MINUS = np.float32(-1.0)
ZERO: Any = np.int64(0)
OUTPUTS: Any = np.int64(3)
"""Not literals, for whose values the kernels would be compiled again."""
SINGULAR = 1e-13
"""Pivots of the coarsest operator below this share of its diagonal are rounding errors."""


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


@compiled()
def _build(
    table: Index,
    r_levels: Array,
    g_levels: Array,
    b_levels: Array,
    stencil: Array,
    smoothness: float,
    twist: float,
    cells: Index,
    shares: Single,
    finest: Array,
    middle: Array,
    anchor: Single,
    couplings: Single,
    diagonal: Single,
    damping: Single,
) -> Array:
    """Fill the hierarchy; returns the Cholesky factors of its coarsest operator, (3, m, m).

    finest, middle: the couplings and the diagonal of the finest lattice, where that holds the anchor, still;
    anchor: the same, planar, and room for the coarser ones.
    """
    depth = len(table) - 1
    longest = cells.shape[2]
    bends, slopes = np.zeros((depth, 3, longest, 3)), np.zeros((depth, 3, longest, 3))
    masses = np.zeros((depth, 3, longest))
    for axis in range(3):
        levels = r_levels if axis == 0 else g_levels if axis == 1 else b_levels
        coarsen_axis(levels, axis, cells, shares, bends, slopes, masses)
    mine, own = finest, middle
    for level in range(depth):
        r, g, b = table[level, 0], table[level, 1], table[level, 2]
        if level > 0:
            mine, own = np.zeros((COUPLINGS, (r + FAR) * g * b)), np.empty((3, r * g * b))
            held = _planar(anchor, table, level)
            for c in range(3):
                for p in range(r * g * b):
                    own[c, p] = held[c, FAR * g * b + p]
        couple(stencil, bends[level], slopes[level], masses[level], smoothness, twist, mine, own)
        singles = _couplings(couplings, table, level), _nodes(diagonal, table, level), _nodes(damping, table, level)
        damp(mine, own, steps(g, b), g * b, *singles)
        if level < depth - 1:
            kr, kg, kb = table[level + 1, 0], table[level + 1, 1], table[level + 1, 2]
            stencil = coarse_stencil(stencil, cells[level], shares[level], kr, kg, kb)
            fine, coarse = _cube(anchor, table, level), _cube(anchor, table, level + 1)
            restrict(fine, cells[level], shares[level], coarse, ZERO, OUTPUTS)
    return _factors(mine, own, g, b)


@compiled()
def _factors(couplings: Array, diagonal: Array, ng: int, nb: int) -> Array:
    """Cholesky factors L of the operator per output; a column is 0 where the pivot says that it is singular."""
    nodes, far, margin = diagonal.shape[1], steps(ng, nb), FAR * ng * nb
    lower = np.zeros((3, nodes, nodes))
    for c in range(3):
        factor = lower[c]
        for p in range(nodes):
            factor[p, p] = diagonal[c, p]
            for t in range(COUPLINGS):
                if p + far[t] < nodes:
                    factor[p + far[t], p] += couplings[t, margin + p]
        for column in range(nodes):
            pivot = factor[column, column]
            for k in range(column):
                pivot -= factor[column, k] ** 2
            scale = 1.0 / np.sqrt(pivot) if pivot > SINGULAR * diagonal[c, column] else 0.0
            for row in range(column + 1, nodes):
                total = factor[row, column]
                for k in range(column):
                    total -= factor[row, k] * factor[column, k]
                factor[row, column] = total * scale
            factor[column, column] = scale  # its inverse, which is what is used
    return lower


@compiled()
def _solve_coarsest(factors: Array, right: Single, b: Single, plane: int) -> None:
    """b = (L L')⁻¹ right."""
    nodes, margin = factors.shape[1], FAR * plane
    x = np.empty(nodes)
    for c in range(3):
        factor = factors[c]
        for row in range(nodes):
            total = right[c, margin + row]
            for k in range(row):
                total -= factor[row, k] * x[k]
            x[row] = total * factor[row, row]
        for row in range(nodes - 1, -1, -1):
            x[row] *= factor[row, row]
            for k in range(row):
                x[k] -= factor[row, k] * x[row]
        for row in range(nodes):
            b[c, margin + row] = x[row]


@compiled()
def _cycle(
    table: Index,
    first: int,
    cells: Index,
    shares: Single,
    couplings: Single,
    diagonal: Single,
    damping: Single,
    factors: Array,
    right: Single,
    b: Single,
    residual: Single,
    correction: Single,
) -> None:
    """The V-cycle from the lattice `first` on down and back, right (flat) → b."""
    last = len(table) - 2
    for step in range(2 * (last - first) + 1):
        level = first + step if step <= last - first else 2 * last - first - step
        g, nb = table[level, 1], table[level, 2]
        r, plane = table[level, 0], g * nb
        y, x = _planar(right, table, level), _planar(b, table, level)
        if level == last:
            _solve_coarsest(factors, y, x, plane)
            continue
        down = step < last - first
        far, rest, z = steps(g, nb), _planar(residual, table, level), _planar(correction, table, level)
        mine, own = _couplings(couplings, table, level), _nodes(diagonal, table, level)
        scale = _nodes(damping, table, level)
        _copy(y, rest)
        if not down:
            coarse, fine = _cube(b, table, level + 1), _cube(b, table, level)
            prolong_add(coarse, cells[level], shares[level], fine, ZERO, OUTPUTS)
            add_product(MINUS, mine, own, far, plane, x, rest, ZERO, r)
        first_step(scale, rest, plane, z, x, down, ZERO, r)
        add_product(MINUS, mine, own, far, plane, z, rest, ZERO, r)
        second_step(scale, rest, plane, z, x, ZERO, r)
        if down:
            _copy(y, rest)
            add_product(MINUS, mine, own, far, plane, x, rest, ZERO, r)
            fine, coarse = _cube(residual, table, level), _cube(right, table, level + 1)
            restrict(fine, cells[level], shares[level], coarse, ZERO, OUTPUTS)


@compiled()
def _copy(source: Single, to: Single) -> None:
    """What `to[:] = source` would do, which takes half a second to compile for its error message."""
    for c in range(3):
        for p in range(source.shape[1]):
            to[c, p] = source[c, p]


class Multigrid:
    """The operator on a lattice and on ever coarser ones, made once for every right-hand side.

    stencil: the data term (14, N_r, N_g, N_b), not changed; anchor: (N_r, N_g, N_b, 3), added to the diagonal;
    smoothness, twist: weights of the second difference along each axis and of the mixed one across each two.
    right, b: (3, nodes and margins) float32, what `cycle` starts from and what it makes of it.
    """

    def __init__(self, levels: Levels, stencil: Array, anchor: Array, smoothness: float, twist: float) -> None:
        r, g, b = (len(axis) for axis in levels)
        self.size = (r, g, b)
        self._table = table = _table(self.size)
        depth, longest = len(table) - 1, max(self.size)
        nodes, lattices, couplings = (int(count) for count in table[-1, 3:])
        cells, shares = (
            np.zeros((depth - 1, 3, longest), dtype=np.int64),
            np.zeros((depth - 1, 3, 2, longest), dtype=np.float32),
        )
        held = planar(anchor)
        middle = held[:, FAR * g * b : -FAR * g * b].copy()
        self._finest = np.zeros((COUPLINGS, (r + FAR) * g * b)), middle, steps(g, b), g * b
        operator = (
            np.empty(couplings, dtype=np.float32),
            np.empty(nodes, dtype=np.float32),
            np.empty(nodes, dtype=np.float32),
        )
        work = np.zeros((4, lattices), dtype=np.float32)
        work[0, : table[1, 4]] = held.ravel()
        data = stencil, smoothness, twist
        factors = _build(table, *levels, *data, cells, shares, *self._finest[:2], work[0], *operator)
        self._hierarchy = cells, shares, *operator, factors
        self._work = work[0], work[1], work[2], work[3]
        self.right, self.b = _planar(work[0], table, 0), _planar(work[1], table, 0)
        self._small = next(level for level in range(depth) if np.prod(table[level, :3]) < SMALL)
        self.threads, self._planes = self._threads(0), self._parts(0)
        self.outputs = slabs(0, 3, 1, self.threads)

    def _threads(self, level: int) -> int:
        r, g, b = self._table[level, :3]
        return max(1, min(cores(), int(r * g * b) // NODES_PER_THREAD))

    def product(self, b: Array, out: Array) -> None:
        """out = A b; both (3, nodes and margins)."""
        out[:] = 0.0
        run(lambda first, last: add_product(1.0, *self._finest, b, out, first, last), self._planes)

    def precondition(self, residual: Array) -> Single:
        """What one cycle makes of a residual (3, nodes and margins); the next call overwrites it."""
        self.right[:] = residual
        self.cycle()
        return self.b

    def cycle(self) -> None:
        """One symmetric V-cycle for A b = right, from b = 0."""
        for level in range(self._small):
            self._visit(level, True)
        _cycle(self._table, self._small, *self._hierarchy, *self._work)
        for level in range(self._small - 1, -1, -1):
            self._visit(level, False)

    def _visit(self, level: int, down: bool) -> None:
        """What `_cycle` does on a lattice, on several threads."""
        table = self._table
        cells, shares = (part[level] for part in self._hierarchy[:2])
        right, b, residual, correction = (_planar(part, table, level) for part in self._work)
        scale = _nodes(self._hierarchy[4], table, level)
        plane = int(table[level, 1] * table[level, 2])
        residual[:] = right
        if not down:
            coarse, fine = _cube(self._work[1], table, level + 1), _cube(self._work[1], table, level)
            run(lambda first, last: prolong_add(coarse, cells, shares, fine, first, last), self.outputs)
            self._subtract_product(level, b, residual)
        parts = self._parts(level)
        run(lambda first, last: first_step(scale, residual, plane, correction, b, down, first, last), parts)
        self._subtract_product(level, correction, residual)
        run(lambda first, last: second_step(scale, residual, plane, correction, b, first, last), parts)
        if down:
            residual[:] = right
            self._subtract_product(level, b, residual)
            source, to = _cube(self._work[2], table, level), _cube(self._work[0], table, level + 1)
            run(lambda first, last: restrict(source, cells, shares, to, first, last), self.outputs)

    def _parts(self, level: int) -> list[tuple[int, int]]:
        r, g, b = (int(count) for count in self._table[level, :3])
        return slabs(0, r, run_planes(g * b), self._threads(level))

    def _subtract_product(self, level: int, b: Single, out: Single) -> None:
        g, nb = (int(count) for count in self._table[level, 1:3])
        couplings = _couplings(self._hierarchy[2], self._table, level)
        diagonal, far = _nodes(self._hierarchy[3], self._table, level), steps(g, nb)
        run(
            lambda first, last: add_product(MINUS, couplings, diagonal, far, g * nb, b, out, first, last),
            self._parts(level),
        )
