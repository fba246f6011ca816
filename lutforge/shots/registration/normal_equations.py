"""Normal equations of a registration: gradients of pictures, summed up over blocks, and solved with a covariance."""

import math
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Index, Single
from lutforge.compiled import REASSOCIATED, compiled

BLOCKS = 32
"""Blocks along the longer side, over which gradients are summed up: a displacement is the same all over one."""
PARTS = 6
"""Parts a side of the picture from whose agreement the covariance of a fit is estimated: their structure is hardly
correlated."""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Blocks of `side` × `side` pixels, (H, W) of them, a rest at the right and bottom left out.

    centres: (H W, 2) x and y of them; part: (H W,) which of the PARTS² parts of the picture each belongs to.
    """

    side: int
    shape: tuple[int, int]
    centres: Array
    part: Index

    @classmethod
    def of(cls, height: int, width: int) -> "Blocks":
        """The blocks of a picture of this size."""
        side = max(8, max(height, width) // BLOCKS)
        down, across = (np.arange(length // side) * side + side / 2 for length in (height, width))
        centres = np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)
        part = (PARTS * centres / (width, height)).astype(np.int64) @ np.array([1, PARTS])
        return cls(side, (len(down), len(across)), centres, part)

    def products(self, moving: Single, target: Single, weight: Single) -> Array:
        """Products (H, W, 5) of gradients: with themselves xx, xy, yy, and with the difference of the two, x, y."""
        sums = np.zeros((*self.shape, 5))
        _add_products(moving, target, weight, self.side, sums)
        return sums

    def equations(self, sums: Array, shifts: Array, prior: Array, deviation: Array) -> "NormalEquations":
        """The normal equations of n parameters, by the chain rule from those of the displacement of each block.

        shifts: (H W, 2, n) displacements by a unit of each parameter; prior, deviation: (n,) as in `NormalEquations`.
        """
        count = shifts.shape[2]
        gradients = sums[..., [0, 1, 1, 2]].reshape(-1, 2, 2) @ shifts
        normal, pull = np.zeros((PARTS**2, count, count)), np.zeros((PARTS**2, count))
        np.add.at(normal, self.part, shifts.swapaxes(1, 2) @ gradients)
        np.add.at(pull, self.part, (shifts.swapaxes(1, 2) @ sums[..., 3:].reshape(-1, 2, 1))[..., 0])
        return NormalEquations(normal, pull, prior, deviation)

    def residual(self, sums: Array) -> float:
        """Root mean square displacement of the parts, each fitted by itself, weighted by its structure, in pixels."""
        total = np.zeros((PARTS**2, 5))
        np.add.at(total, self.part, sums.reshape(-1, 5))
        strength = total[:, [0, 2]].sum(axis=1) + 1e-12
        # A little of the mean keeps a part without structure where it is.
        matrix = total[:, [0, 1, 1, 2]].reshape(-1, 2, 2) + 0.01 * strength.mean() * np.eye(2)
        square = np.square(np.linalg.solve(matrix, total[:, 3:, None])).sum(axis=(1, 2))
        return math.sqrt(np.average(square, weights=strength))


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """The equations of a Gauss–Newton step of n parameters, for each of the parts of the picture.

    normal: (parts, n, n) normal matrices; pull: (parts, n) right sides; prior, deviation: (n,) weight of a prior of
    the parameters, and how far they are from it.
    """

    normal: Array
    pull: Array
    prior: Array
    deviation: Array

    def first(self, count: int) -> "NormalEquations":
        """The equations of the first parameters, the others held as they are."""
        return NormalEquations(
            self.normal[:, :count, :count], self.pull[:, :count], self.prior[:count], self.deviation[:count]
        )

    def solved(self) -> tuple[Array, Array]:
        """The step (n,), and its covariance by the parts of the picture (White 1980, a sandwich)."""
        # Parameters have different units: the matrix is scaled to a diagonal of ones before it is inverted.
        total = self.normal.sum(axis=0) + np.diag(self.prior)
        unit = 1 / np.sqrt(np.diag(total) + 1e-30)
        inverse = unit[:, None] * np.linalg.pinv(total * np.outer(unit, unit)) * unit
        step = inverse @ (self.pull.sum(axis=0) - self.prior * self.deviation)
        scores = self.pull - self.normal @ step
        count = len(self.pull)
        return step, inverse @ (scores.T @ scores) @ inverse * count / (count - len(step))


@compiled(fastmath=REASSOCIATED)
def _add_products(moving: Single, target: Single, weight: Single, side: int, sums: Array) -> None:
    """Fill the products (H, W, 5) of the gradient with itself, xx, xy, yy, and with what is to change, x, y, by blocks.

    The gradient is of the mean of both pictures (h, w): an unbiased, faster converging step (Benhimane & Malis 2004,
    https://doi.org/10.1109/IROS.2004.1389474).
    """
    down, across = sums.shape[:2]
    width = across * side
    terms, quarter = np.zeros((3, width), np.float32), np.float32(0.25)
    for row in range(1, min(down * side, moving.shape[0] - 1)):
        above, here, below = moving[row - 1], moving[row], moving[row + 1]
        target_above, target_here, target_below = target[row - 1], target[row], target[row + 1]
        for x in range(1, min(width, moving.shape[1] - 1)):
            share = quarter * weight[row, x]
            terms[0, x] = share * (here[x + 1] - here[x - 1] + target_here[x + 1] - target_here[x - 1])
            terms[1, x] = share * (below[x] - above[x] + target_below[x] - target_above[x])
            terms[2, x] = weight[row, x] * (target_here[x] - here[x])

        for block in range(across):
            xx = xy = yy = by_x = by_y = np.float32(0)
            for x in range(block * side, (block + 1) * side):
                xx += terms[0, x] * terms[0, x]
                xy += terms[0, x] * terms[1, x]
                yy += terms[1, x] * terms[1, x]
                by_x += terms[0, x] * terms[2, x]
                by_y += terms[1, x] * terms[2, x]
            to = sums[row // side, block]
            to[0] += xx
            to[1] += xy
            to[2] += yy
            to[3] += by_x
            to[4] += by_y
