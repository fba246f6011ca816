"""Solve S b = r for the nodes of a cube, S a symmetric 27-point stencil: conjugate gradients with a diagonal
preconditioner.

S is bound by memory: of its half, diagonals that are all zero are left out (tetrahedral weights join a node with 14
others, not 26), and the others kept in float32, in which it stays symmetric. Sums are formed
per plane and then over the planes, so that the same input gives the same bytes on any number of cores.
"""

from functools import partial

import numpy as np
from numpy.typing import NDArray

from lutforge.compiled import compiled
from lutforge.threads import cores, run, slabs

Array = NDArray[np.float64]
Half = NDArray[np.float32]
Offsets = NDArray[np.int64]


def solve(stencil: Array, right: Array, start: Array, goal: float, most_steps: int) -> Array:
    """b (N, N, N, 3). stencil: (14, N, N, N), as `normal_equations` gives it; right, start: as b.

    goal: what is to be left of the residual of the start. Time O(N³) per step, multi-threaded.
    """
    half, offsets = _half(stencil)
    inverse = _padded(1 / stencil[0])
    b = _padded(np.moveaxis(start, 3, 0))
    image, direction = np.zeros_like(b), np.zeros_like(b)
    planes, sums = slabs(1, b.shape[1] - 1, 1, cores()), np.zeros((b.shape[1], 3))

    def applied(lattices: Array) -> Array:
        """S times them into image; their product with it, (3,)."""
        run(lambda first, last: _image(half, offsets, lattices, image, sums, first, last), planes)
        return np.asarray(sums.sum(axis=0))

    def moved(step: Array) -> Array:
        """One step along the direction; residual · D⁻¹ residual, (3,)."""
        run(lambda first, last: _move(inverse, residual, step, image, direction, b, sums, first, last), planes)
        return np.asarray(sums.sum(axis=0))

    applied(b)
    residual = _padded(np.moveaxis(right, 3, 0)) - image
    rho = moved(np.zeros(3))
    least, beta = goal**2 * rho, np.zeros(3)
    for _ in range(most_steps):
        if np.all(rho <= least):
            break
        run(partial(_turn, inverse, residual, beta, direction), planes)
        step = rho / np.maximum(applied(direction), 1e-300)
        rho, previous = moved(step), rho
        beta = rho / np.maximum(previous, 1e-300)
    return np.ascontiguousarray(np.moveaxis(b[:, 1:-1, 1:-1, 1:-1], 0, 3))


def _half(stencil: Array) -> tuple[Half, Offsets]:
    """The diagonals that are not zero, (K, N + 2, N + 2, N + 2), and where they lie, (K, 3)."""
    kept = [index for index in range(len(stencil)) if np.any(stencil[index])]
    half = np.zeros((len(kept), *(n + 2 for n in stencil.shape[1:])), dtype=np.float32)
    half[:, 1:-1, 1:-1, 1:-1] = stencil[kept]
    offsets = [((index + 13) // 9 - 1, (index + 13) // 3 % 3 - 1, (index + 13) % 3 - 1) for index in kept]
    return half, np.array(offsets)


def _padded(values: Array) -> Array:
    """With a layer of zeros around the last three axes."""
    width = [(0, 0)] * (values.ndim - 3) + [(1, 1)] * 3
    return np.ascontiguousarray(np.pad(values, width))


@compiled(fastmath=True)
def _image(half: Half, offsets: Offsets, b: Array, image: Array, sums: Array, first: int, last: int) -> None:
    """image = S b of some planes; sums: of b·image, per plane and output."""
    length = b.shape[3] - 2
    for i in range(first, last):
        sums[i] = 0.0
        for j in range(1, b.shape[2] - 1):
            for c in range(3):
                row, here, middle = image[c, i, j, 1:-1], b[c, i, j, 1:-1], half[0, i, j, 1:-1]
                for k in range(length):
                    row[k] = middle[k] * here[k]
                for o in range(1, half.shape[0]):
                    di, dj, dk = offsets[o, 0], offsets[o, 1], offsets[o, 2]
                    ahead, after = half[o, i, j, 1:-1], b[c, i + di, j + dj, 1 + dk : 1 + dk + length]
                    behind = half[o, i - di, j - dj, 1 - dk : 1 - dk + length]
                    before = b[c, i - di, j - dj, 1 - dk : 1 - dk + length]
                    for k in range(length):
                        row[k] += ahead[k] * after[k] + behind[k] * before[k]
                total = 0.0
                for k in range(length):
                    total += row[k] * here[k]
                sums[i, c] += total


@compiled(fastmath=True)
def _move(
    inverse: Array,
    residual: Array,
    step: Array,
    image: Array,
    direction: Array,
    b: Array,
    sums: Array,
    first: int,
    last: int,
) -> None:
    """b += step · direction, residual −= step · image; sums: of residual·D⁻¹ residual, per plane and output."""
    for i in range(first, last):
        for c in range(3):
            total = 0.0
            for j in range(1, b.shape[2] - 1):
                for k in range(1, b.shape[3] - 1):
                    b[c, i, j, k] += step[c] * direction[c, i, j, k]
                    r = residual[c, i, j, k] - step[c] * image[c, i, j, k]
                    residual[c, i, j, k] = r
                    total += r * r * inverse[i, j, k]
            sums[i, c] = total


@compiled(fastmath=True)
def _turn(inverse: Array, residual: Array, beta: Array, direction: Array, first: int, last: int) -> None:
    """direction = D⁻¹ residual + beta · direction."""
    for i in range(first, last):
        for c in range(3):
            for j in range(1, direction.shape[2] - 1):
                for k in range(1, direction.shape[3] - 1):
                    direction[c, i, j, k] = inverse[i, j, k] * residual[c, i, j, k] + beta[c] * direction[c, i, j, k]
