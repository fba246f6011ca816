"""Lattice regression written out densely, a matrix a term, for lattices small enough to invert."""

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, interpolate

Array = NDArray[np.float64]


def random_levels(rng: np.random.Generator, size: tuple[int, int, int]) -> Levels:
    """Strictly increasing levels from 0 to 1, far from even."""
    r, g, b = (np.concatenate([[0.0], np.cumsum(rng.uniform(0.1, 2.0, count - 1))]) for count in size)
    return (r / r[-1], g / g[-1], b / b[-1])


def interpolation_weights(x: Array, levels: Levels, method: Interpolation) -> Array:
    """W (n, m): the response of the interpolation to each unit lattice."""
    shape = tuple(len(axis) for axis in levels)
    units = np.eye(int(np.prod(shape))).reshape(*shape, -1)
    return interpolate(x, levels, units, method)


def along(matrix: Array, shape: tuple[int, ...], axis: int) -> Array:
    """The (…, m) matrix that applies `matrix` along one axis of a lattice of that shape."""
    factors = [np.eye(count) for count in shape]
    factors[axis] = matrix
    return np.asarray(np.kron(np.kron(factors[0], factors[1]), factors[2]))


def second_differences(levels: Levels) -> Array:
    """S, row by row from the definition of thesis 5.4."""
    shape = tuple(len(axis) for axis in levels)
    parts = []
    for axis, nodes in enumerate(levels):
        rows = np.zeros((len(nodes) - 2, len(nodes)))
        for i in range(1, len(nodes) - 1):
            before, after = nodes[i] - nodes[i - 1], nodes[i + 1] - nodes[i]
            rows[i - 1, i - 1 : i + 2] = -after / (before + after), 1.0, -before / (before + after)
        parts.append(along(rows, shape, axis))
    return np.concatenate(parts)


def mixed_differences(shape: tuple[int, int, int]) -> Array:
    """T: the difference of differences over each square of neighbours, for each pair of axes."""
    first = [along(np.diff(np.eye(count), axis=0), shape, axis) for axis, count in enumerate(shape)]
    parts = []
    for one, two in ((0, 1), (0, 2), (1, 2)):
        narrow = list(shape)
        narrow[two] -= 1
        inner = first[two]
        outer = along(np.diff(np.eye(shape[one]), axis=0), tuple(narrow), one)
        parts.append(outer @ inner)
    return np.concatenate(parts)
