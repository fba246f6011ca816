"""The smoothness terms of lattice regression, all sums of tensor products of banded matrices of one axis."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy import sparse

from lutforge.arrays import Array
from lutforge.interpolation import Levels
from lutforge.solvers.normal_equations import symmetric


def second_difference(levels: Array) -> Array:
    """The (N − 2, N) three-point second difference S of one axis (thesis 5.4).

    For neighbours 1, 2, 3 at distances d12, d23 the row is −d23/(d12 + d23), 1, −d12/(d12 + d23): it vanishes on
    functions that are linear along the axis.
    """
    widths, unit = np.diff(levels), np.eye(len(levels))
    share = (widths[:-1] / (widths[:-1] + widths[1:]))[:, None]
    return np.asarray((share - 1.0) * unit[:-2] + unit[1:-1] - share * unit[2:])


def smoothness_matrix(levels: Levels, smoothness: float, mixed: float) -> sparse.dia_array:
    """λ_S S'S + λ_T T'T, (N³, N³): second differences along each axis, and mixed ones across each pair of axes."""
    r, g, b = (len(axis) for axis in levels)
    none = [_bands(np.eye(count)) for count in (r, g, b)]
    bend = [_bands(rows.T @ rows) for rows in map(second_difference, levels)]
    slope = [_bands(rows.T @ rows) for rows in (np.diff(np.eye(count), axis=0) for count in (r, g, b))]
    terms = [(smoothness, [bend[c] if c == axis else none[c] for c in range(3)]) for axis in range(3)]
    terms += [(mixed, [none[c] if c == axis else slope[c] for c in range(3)]) for axis in range(3)]

    def half() -> Iterator[tuple[tuple[int, int, int], Array]]:
        for weight, (of_r, of_g, of_b) in terms:
            for dr, dg, db in product(of_r, of_g, of_b):
                if (dr, dg, db) >= (0, 0, 0) and weight:
                    yield (dr, dg, db), weight * np.einsum("i,j,k->ijk", of_r[dr], of_g[dg], of_b[db])

    return symmetric((r, g, b), half())


def _bands(matrix: Array) -> dict[int, Array]:
    """The diagonals of a banded matrix (N, N) that are not 0, by step: entries (i, i + step), (N,), 0 beyond."""
    count, bands = len(matrix), dict[int, Array]()
    for step in range(max(-2, 1 - count), min(3, count)):
        line = np.pad(np.diag(matrix, step), (max(-step, 0), max(step, 0)))
        if np.any(line):
            bands[step] = line
    return bands


def keys_cubic(count: int) -> tuple[Array, Array, Array]:
    """Gram matrices of Keys' cubic convolution basis on `count` nodes at unit spacing.

    Returns (mass, slope, bend), each (count, count): integrals of products of the basis functions, their first and
    their second derivatives over the axis, ends extrapolated linearly. Keys (1981), a = −1/2.
    """
    # Coefficients of t⁰ … t³ for the four nodes around a unit interval.
    cell = 0.5 * np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]], dtype=np.float64)
    unit = np.eye(count)
    nodes = np.vstack([2.0 * unit[0] - unit[1], unit, 2.0 * unit[-1] - unit[-2]])  # with one beyond either end
    grams = []
    for order in range(3):
        coefficients = np.polynomial.polynomial.polyder(cell, order, axis=1)
        power = np.arange(coefficients.shape[1])
        gram = coefficients @ (1.0 / (power[:, None] + power + 1.0)) @ coefficients.T
        grams.append(
            sum((around.T @ gram @ around for around in (nodes[i : i + 4] for i in range(count - 1))), 0 * unit)
        )
    return grams[0], grams[1], grams[2]


@dataclass(frozen=True, eq=False)
class ThinPlate:
    """The thin-plate regulariser λ_K b'Kb of Garcia & Gupta (2009): ∫ Σ (∂²f/∂u∂v)² with tricubic interpolation.

    In index space (unit spacing), as the thesis builds it once for each lattice size. axes: (mass, slope, bend) of each
    axis; weight: λ_K.
    """

    axes: Sequence[Sequence[Array]]
    weight: float = 1.0

    def __call__(self, b: Array) -> Array:
        """Return λ_K K b for lattices (…, N_r, N_g, N_b): a sum of tensor products, one axis after the other."""
        (mr, sr, br), (mg, sg, bg), (mb, sb, bb) = self.axes
        mass, slope, bend = b @ mb, b @ sb, b @ bb
        of_br = mg @ mass
        of_sr = 2.0 * (sg @ mass + mg @ slope)
        of_mr = bg @ mass + mg @ bend + 2.0 * (sg @ slope)
        planes = (*b.shape[:-2], b.shape[-2] * b.shape[-1])
        image = br @ of_br.reshape(planes) + sr @ of_sr.reshape(planes) + mr @ of_mr.reshape(planes)
        return np.asarray(self.weight * image.reshape(b.shape))

    def diagonal(self) -> Array:
        """The diagonal of λ_K K, (N_r, N_g, N_b)."""
        alone = [[np.diag(np.diag(matrix)) for matrix in axis] for axis in self.axes]
        return ThinPlate(alone, self.weight)(np.ones([len(axis[0]) for axis in self.axes]))

    def through(self, interpolations: Sequence[Array]) -> "ThinPlate":
        """P'KP of a coarser lattice, from which matrices (N, M) interpolate along each axis."""
        pairs = zip(self.axes, interpolations, strict=True)
        return ThinPlate([[p.T @ matrix @ p for matrix in axis] for axis, p in pairs], self.weight)


def thin_plate(size: tuple[int, int, int], weight: float = 1.0) -> ThinPlate:
    """The thin-plate term for a lattice of `size` nodes, λ_K its weight."""
    return ThinPlate([keys_cubic(count) for count in size], weight)
