"""The operator A of lattice regression as a stencil, and its product with a lattice.

A couples a node with its 26 neighbours, and with those two steps away along the axes. It is symmetric: kept are the
diagonal, which may differ between the outputs, and the 16 couplings with nodes that follow. Lattices are planar, a
lattice of an output after the other, with FAR planes of zeros before and after it; so a neighbour is a fixed step away,
wherever a node lies (couplings beyond an edge are 0), and each coupling is one loop over a run of nodes, that the
compiler vectorizes. A run's sums do not depend on how planes are dealt out to threads.
"""

from functools import partial

import numpy as np

from lutforge.arrays import Array, Index, Real, Single
from lutforge.compiled import compiled
from lutforge.threads import cores, run, slabs

FAR = 2
"""Planes that a coupling reaches."""
COUPLINGS = 16
"""13 with neighbours, in the order of `normal_equations`, and those at (2, 0, 0), (0, 2, 0), (0, 0, 2)."""


@compiled()
def steps(ng: int, nb: int) -> Index:
    """(COUPLINGS,): how far the node of each coupling lies, in a lattice of planes ng × nb."""
    far = np.empty(COUPLINGS, dtype=np.int64)
    for t in range(13):
        offset = t + 14
        far[t] = ((offset // 9 - 1) * ng + offset // 3 % 3 - 1) * nb + offset % 3 - 1
    far[13], far[14], far[15] = 2 * ng * nb, 2 * nb, 2
    return far


@compiled()
def run_planes(plane: int) -> int:
    """How many planes of that many nodes make a run: about 1,024 nodes, which stay in the nearest cache."""
    return max(1, 1024 // plane)


def planar(values: Array) -> Array:
    """Node values (N_r, N_g, N_b, 3) as (3, nodes and FAR planes of zeros on both sides)."""
    r, g, b, _ = values.shape
    lattices = np.zeros((3, r + 2 * FAR, g, b))
    lattices[:, FAR:-FAR] = values.transpose(3, 0, 1, 2)
    return lattices.reshape(3, -1)


def from_planar(lattices: Real, size: tuple[int, int, int]) -> Array:
    """The node values (N_r, N_g, N_b, 3) again."""
    r, g, b = size
    values = lattices.reshape(3, r + 2 * FAR, g, b)[:, FAR:-FAR].transpose(1, 2, 3, 0)
    return np.ascontiguousarray(values, dtype=np.float64)


@compiled()
def couple(
    stencil: Array,
    bends: Array,
    slopes: Array,
    masses: Array,
    smoothness: float,
    mixed: float,
    couplings: Array,
    diagonal: Array,
) -> None:
    """Fill the couplings (COUPLINGS, (N_r + FAR) · N_g · N_b), and add to the diagonal (3, nodes), the same for each.

    stencil: the data term, as `normal_equations` gives it. Per axis, (3, N or more, …): bends, the penalty on the
    second difference at offsets 0, 1, 2; slopes, that on the first difference at −1, 0, 1; masses, what the axis weighs
    in the penalties of the others.
    """
    nr, ng, nb = stencil.shape[1:]
    mass, shared = masses[2, :nb], np.empty(nb)
    for i in range(nr):
        mr = masses[0, i]
        for j in range(ng):
            mg = masses[1, j]
            first = (i * ng + j) * nb
            start = FAR * ng * nb + first
            for t in range(14):  # 0 is the node itself
                dr, dg, db = (t + 13) // 9 - 1, (t + 13) // 3 % 3 - 1, (t + 13) % 3 - 1
                sr, sg = slopes[0, i, dr + 1], slopes[1, j, dg + 1]
                even = mixed * sr * sg if db == 0 else 0.0
                if dg == 0 and db == 0:
                    even += smoothness * bends[0, i, dr] * mg
                if dr == 0 and db == 0:
                    even += smoothness * bends[1, j, dg] * mr
                sloped = mixed * ((sr * mg if dg == 0 else 0.0) + (mr * sg if dr == 0 else 0.0))
                bent = smoothness * mr * mg if dr == 0 and dg == 0 else 0.0
                to = shared if t == 0 else couplings[t - 1, start : start + nb]
                data, slope, bend = stencil[t, i, j], slopes[2, :nb, db + 1], bends[2, :nb, max(db, 0)]
                for k in range(nb):
                    to[k] = data[k] + even * mass[k] + sloped * slope[k] + bent * bend[k]
            for c in range(3):
                for k in range(nb):
                    diagonal[c, first + k] += shared[k]
            far_r, far_g = smoothness * bends[0, i, 2] * mg, smoothness * mr * bends[1, j, 2]
            far_b = smoothness * mr * mg
            for k in range(nb):
                couplings[13, start + k] = far_r * mass[k]
                couplings[14, start + k] = far_g * mass[k]
                couplings[15, start + k] = far_b * bends[2, k, 2]


@compiled(fastmath={"contract"})
def add_product(
    sign: float | np.float32,
    couplings: Real,
    diagonal: Real,
    far: Index,
    plane: int,
    b: Real,
    out: Real,
    first: int,
    last: int,
) -> None:
    """Add sign · A b to out on the planes first … last − 1; first: a multiple of run_planes(plane).

    far: how far the node of each coupling lies, an even number of them; diagonal: (3, nodes); b, out: (3, nodes and FAR
    planes on both sides).
    """
    planes = run_planes(plane)
    for begin in range(first, last, planes):
        count = (min(begin + planes, last) - begin) * plane
        node = begin * plane
        start = node + FAR * plane
        for c in range(3):
            to, at, own = out[c, start : start + count], b[c, start : start + count], diagonal[c, node : node + count]
            for p in range(count):
                to[p] += sign * own[p] * at[p]
        for t in range(0, len(far), 2):  # two at a time, which halves the traffic of `out`
            one, two = far[t], far[t + 1]
            ahead, behind = couplings[t, start : start + count], couplings[t, start - one : start - one + count]
            ahead2, behind2 = (
                couplings[t + 1, start : start + count],
                couplings[t + 1, start - two : start - two + count],
            )
            for c in range(3):
                to = out[c, start : start + count]
                after, before = b[c, start + one : start + one + count], b[c, start - one : start - one + count]
                after2, before2 = b[c, start + two : start + two + count], b[c, start - two : start - two + count]
                for p in range(count):
                    to[p] += sign * (
                        ahead[p] * after[p] + behind[p] * before[p] + ahead2[p] * after2[p] + behind2[p] * before2[p]
                    )


@compiled()
def damp(
    couplings: Array,
    diagonal: Array,
    far: Index,
    plane: int,
    single_couplings: Single,
    single_diagonal: Single,
    damping: Single,
) -> None:
    """damping = 1 / Σ |row of A| (3, nodes): with it as a preconditioner no eigenvalue is above 1 (Gershgorin).

    Fills the operator in float32, too.
    """
    nodes = diagonal.shape[1]
    margin = FAR * plane
    others = np.zeros(nodes)
    for t in range(COUPLINGS):
        ahead, behind = couplings[t, margin : margin + nodes], couplings[t, margin - far[t] : margin - far[t] + nodes]
        for p in range(nodes):
            others[p] += abs(ahead[p]) + abs(behind[p])
        for p in range(couplings.shape[1]):
            single_couplings[t, p] = couplings[t, p]
    for c in range(3):
        own, single, to = diagonal[c], single_diagonal[c], damping[c]
        for p in range(nodes):
            single[p] = own[p]
            to[p] = 1.0 / max(others[p] + own[p], 1e-300)


class StencilOperator:
    """A 27-point stencil as an operator on planar lattices, preconditioned by its diagonal.

    A product is bound by memory, so couplings that are 0 everywhere are left out (tetrahedral weights join a node with
    14 others, not with 26), and the others kept in float32.
    """

    def __init__(self, stencil: Array) -> None:
        """Take a stencil (14, N_r, N_g, N_b) as `normal_equations` gives it, with a positive diagonal."""
        _, r, g, b = stencil.shape
        self.size, self.threads = (r, g, b), cores()
        kept = [t for t in range(1, 14) if np.any(stencil[t])]
        even = len(kept) + len(kept) % 2
        couplings = np.zeros((even, (r + FAR) * g * b), dtype=np.float32)
        couplings[: len(kept), FAR * g * b :] = stencil[kept].reshape(len(kept), -1)
        far = np.ones(even, dtype=np.int64)
        far[: len(kept)] = steps(g, b)[np.array(kept, dtype=np.int64) - 1]
        self._operator = couplings, np.repeat(stencil[:1].reshape(1, -1), 3, axis=0), far, g * b
        self._inverse = planar(np.repeat(1 / stencil[0][..., None], 3, axis=3))
        self._planes = slabs(0, r, run_planes(g * b), self.threads)

    def product(self, b: Array, out: Array) -> None:
        """Fill out with A b; both (3, nodes and margins)."""
        out[:] = 0.0
        run(partial(add_product, 1.0, *self._operator, b, out), self._planes)

    def precondition(self, residual: Array) -> Array:
        """The residual divided by the diagonal."""
        return self._inverse * residual
