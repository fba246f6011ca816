"""The smoothness terms of lattice regression, as banded matrices of one axis.

Both terms are sums of tensor products of one-dimensional matrices, so a lattice of N³ nodes only ever stores O(N).
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.compiled import compiled


@compiled()
def second_difference(levels: Array) -> Array:
    """The (N − 2, N) three-point second difference S of one axis (thesis 5.4).

    For neighbours 1, 2, 3 at distances d12, d23 the row is −d23/(d12 + d23), 1, −d12/(d12 + d23): it vanishes on
    functions that are linear along the axis.
    """
    count = len(levels)
    rows = np.zeros((max(count - 2, 0), count))
    for row in range(count - 2):
        before, after = levels[row + 1] - levels[row], levels[row + 2] - levels[row + 1]
        share = before / (before + after)
        rows[row, row], rows[row, row + 1], rows[row, row + 2] = share - 1.0, 1.0, -share
    return rows


@compiled()
def bending(levels: Array) -> Array:
    """S'S, (N, N)."""
    rows, count = second_difference(levels), len(levels)
    gram = np.zeros((count, count))
    for row in range(count - 2):
        for p in range(row, row + 3):
            for q in range(row, row + 3):
                gram[p, q] += rows[row, p] * rows[row, q]
    return gram


def keys_cubic(count: int) -> tuple[Array, Array, Array]:
    """Gram matrices of Keys' cubic convolution basis on `count` nodes at unit spacing.

    Returns (mass, slope, bend), each (count, count): integrals of products of the basis functions, their first and
    their second derivatives over the axis, ends extrapolated linearly. Keys (1981), a = −1/2.
    """
    # Coefficients of t⁰ … t³ for the four nodes around a unit interval.
    cell = 0.5 * np.array([[0, -1, 2, -1], [2, 0, -5, 3], [0, 1, 4, -3], [0, 0, -1, 1]], dtype=np.float64)
    power = np.arange(4)
    derivatives = []
    for order in range(3):
        scale = np.prod([np.maximum(power - step, 0) for step in range(order)], axis=0) if order else 1.0
        shifted = np.zeros((4, 4))
        shifted[:, : 4 - order] = (cell * scale)[:, order:]
        derivatives.append(shifted)
    moment = 1.0 / (power[:, None] + power[None, :] + 1.0)
    result = []
    for coefficients in derivatives:
        gram = coefficients @ moment @ coefficients.T
        total = np.zeros((count, count))
        for start in range(count - 1):
            spread = _neighbours(start, count)
            total += spread.T @ gram @ spread
        result.append(total)
    return result[0], result[1], result[2]


def _neighbours(start: int, count: int) -> Array:
    """(4, count): the values at nodes start − 1 … start + 2, beyond the ends by linear extrapolation."""
    spread = np.zeros((4, count))
    for row, node in enumerate(range(start - 1, start + 3)):
        if 0 <= node < count:
            spread[row, node] = 1.0
        elif node < 0:
            spread[row, [0, 1]] = 2.0, -1.0
        else:
            spread[row, [count - 1, count - 2]] = 2.0, -1.0
    return spread


@dataclass(frozen=True, eq=False)
class ThinPlate:
    """The thin-plate regulariser b'Kb of Garcia & Gupta (2009): ∫ Σ (∂²f/∂u∂v)² with tricubic interpolation.

    In index space (unit spacing), as the thesis builds it once for each lattice size. `axes` holds (mass, slope, bend)
    for each axis.
    """

    axes: tuple[tuple[Array, Array, Array], tuple[Array, Array, Array], tuple[Array, Array, Array]]

    def __call__(self, b: Array) -> Array:
        """Return K b for node values (N_r, N_g, N_b, C): a sum of tensor products, one axis after the other."""
        (mr, sr, br), (mg, sg, bg), (mb, sb, bb) = self.axes
        mass, slope, bend = (_along(2, matrix, b) for matrix in (mb, sb, bb))
        one = _along(1, mg, mass)
        two = _along(1, 2 * sg, mass) + _along(1, 2 * mg, slope)
        three = _along(1, bg, mass) + _along(1, mg, bend) + _along(1, 2 * sg, slope)
        return _along(0, br, one) + _along(0, sr, two) + _along(0, mr, three)


def _along(axis: int, matrix: Array, b: Array) -> Array:
    """A matrix (N, N) times b along one of its axes."""
    return np.moveaxis(np.tensordot(matrix, b, axes=(1, axis)), 0, axis)


def thin_plate(size: tuple[int, int, int]) -> ThinPlate:
    """The thin-plate term for a lattice of `size` nodes."""
    r, g, b = (keys_cubic(count) for count in size)
    return ThinPlate((r, g, b))
