"""The equations of `joint_fit`, sample by sample: residuals, their slopes, and products with them.

Samples have four nodes of the linearization around them, and where they lead to four or eight of the render. Sums over
samples are taken in one order whatever the number of threads.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.compiled import compiled
from lutforge.interpolation import locate
from lutforge.ocio.preimage import CLIPPED, falling_axes, value_and_slope

Array = NDArray[np.float64]
Index = NDArray[np.int64]

OUTSIDE = 0.3
"""Slope of the residual beyond the RAW range and beyond the ends of the response, where the render itself is flat."""
BARELY = 0.02
"""Of a lattice value beyond the end of the response: the farther, the less a clipped channel is held from returning."""
MARGIN = 1e-3
"""Of a lattice value beyond the end of the response, for a channel that is clipped to stay so between
the nodes."""
CHUNKS = 4
"""Parts whose sums are taken apart: as many on every machine, so that the result does not depend on its cores."""


@compiled()
def _corners(levels: Array, tetrahedral: bool, x: Array, fraction: Array, nodes: Index, weights: Array) -> None:
    """The nodes around x (3,), four of a tetrahedron or eight of a cell, and their weights."""
    size = levels.shape[1]
    i, fraction[0] = locate(levels[0], x[0])
    j, fraction[1] = locate(levels[1], x[1])
    k, fraction[2] = locate(levels[2], x[2])
    node = (i * size + j) * size + k
    if not tetrahedral:
        for corner in range(8):
            p, q, r = corner >> 2, (corner >> 1) & 1, corner & 1
            nodes[corner] = node + (p * size + q) * size + r
            weights[corner] = (
                (fraction[0] if p else 1 - fraction[0])
                * (fraction[1] if q else 1 - fraction[1])
                * (fraction[2] if r else 1 - fraction[2])
            )
        return
    rest = 1.0
    for corner, axis in enumerate(falling_axes(fraction)):
        nodes[corner], weights[corner] = node, rest - fraction[axis]
        node, rest = node + (size * size if axis == 0 else (size if axis == 1 else 1)), fraction[axis]
    nodes[3], weights[3] = node, rest


@compiled()
def locate_in_tetrahedra(x: Array, levels: Array, nodes: Index, weights: Array, first: int, last: int) -> None:
    """Fill the four nodes (n, 4) around some of x (n, 3), and their weights (n, 4)."""
    fraction = np.empty(3)
    for n in range(first, last):
        _corners(levels, True, x[n], fraction, nodes[n], weights[n])


@compiled()
def residuals(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    response: Array,
    jpeg: Array,
    nodes: Index,
    weights: Array,
    lattice: Array,
    left: Array,
    slopes: Array,
    steeps: Array,
    render_nodes: Index,
    render_weights: Array,
    begin: int,
    end: int,
) -> None:
    """left (n, 3), of some samples: JPEG − render(lattice), rising on where the render is flat; slopes (n, 3, 3): its
    change by RAW."""
    last = len(response) - 1
    raw, inside, y, slope = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    for n in range(begin, end):
        for c in range(3):
            raw[c] = 0.0
            for corner in range(4):
                raw[c] += weights[n, corner] * lattice[nodes[n, corner], c]
            inside[c] = min(max(raw[c], levels[c, 0]), levels[c, -1])
        value_and_slope(values, levels, tetrahedral, inside, y, slope)
        _corners(levels, tetrahedral, inside, steeps[n], render_nodes[n], render_weights[n])
        for c in range(3):
            beyond = min(y[c], 0.0) + max(y[c] - 1.0, 0.0)
            if beyond != 0.0:
                encoded, steep = response[0 if beyond < 0 else last, c] + OUTSIDE * beyond, OUTSIDE
            else:
                place = min(int(y[c] * last), last - 1)
                steep = (response[place + 1, c] - response[place, c]) * last
                encoded = response[place, c] + (y[c] * last - place) * (response[place + 1, c] - response[place, c])
            rest = jpeg[n, c] - encoded
            side = 1 if jpeg[n, c] >= 1 - CLIPPED else (-1 if jpeg[n, c] <= CLIPPED else 0)
            if side != 0 and side * (y[c] - 0.5) >= 0.5 + MARGIN:
                rest = 0.0  # clipped, as it should be
                if abs(beyond) > BARELY:
                    steep = OUTSIDE * BARELY / abs(beyond)
            else:
                rest += side * steep * MARGIN
            out = raw[c] - inside[c]
            left[n, c] = rest - OUTSIDE * out
            steeps[n, c] = steep
            for axis in range(3):
                slopes[n, c, axis] = steep * slope[c, axis] if raw[axis] == inside[axis] else 0.0
            if out != 0.0:
                slopes[n, c, c] += OUTSIDE


@compiled()
def gather(
    nodes: Index, weights: Array, render_nodes: Index, render_weights: Array, slopes: Array, steep: Array, left: Array,
    total: Array,
) -> None:  # fmt: skip
    for n in range(len(nodes)):
        for c in range(3):
            y = slopes[n, 0, c] * left[n, 0] + slopes[n, 1, c] * left[n, 1] + slopes[n, 2, c] * left[n, 2]
            for corner in range(nodes.shape[1]):
                total[nodes[n, corner], c] += weights[n, corner] * y
            for corner in range(render_nodes.shape[1]):
                total[render_nodes[n, corner], c] += render_weights[n, corner] * steep[n, c] * left[n, c]


@compiled()
def own_blocks(nodes: Index, weights: Array, slopes: Array, hold: Array, own: Array) -> None:
    """The diagonal blocks of the linearization's nodes, (N³, 3, 3)."""
    block = np.empty((3, 3))
    for n in range(len(nodes)):
        for c in range(3):
            for d in range(c + 1):
                total = 0.0
                for e in range(3):
                    total += slopes[n, e, c] * slopes[n, e, d]
                block[c, d] = block[d, c] = total
            block[c, c] += hold[n]
        for corner in range(4):
            w = weights[n, corner] ** 2
            for c in range(3):
                for d in range(3):
                    own[nodes[n, corner], c, d] += w * block[c, d]


@compiled()
def own_diagonal(nodes: Index, weights: Array, steep: Array, own: Array) -> None:
    """The diagonal of the render's nodes, (M³, 3)."""
    for n in range(len(nodes)):
        for corner in range(nodes.shape[1]):
            for c in range(3):
                own[nodes[n, corner], c] += (weights[n, corner] * steep[n, c]) ** 2


@compiled()
def through_and_back(
    nodes: Index, weights: Array, render_nodes: Index, render_weights: Array, slopes: Array, steep: Array,
    hold: Array, caution: Array, direction: Array, sums: Array, begin: int, end: int,
) -> None:  # fmt: skip
    """J'J direction, in some of CHUNKS sums."""
    count, corners = len(nodes), render_nodes.shape[1]
    for chunk in range(begin, end):
        total, x, z, t = sums[chunk], np.empty(3), np.empty(3), np.empty(3)
        for n in range(chunk * count // CHUNKS, (chunk + 1) * count // CHUNKS):
            for c in range(3):
                x[c] = z[c] = 0.0
            for corner in range(4):
                node, w = nodes[n, corner], weights[n, corner]
                for c in range(3):
                    x[c] += w * direction[node, c]
            for corner in range(corners):
                node, w = render_nodes[n, corner], render_weights[n, corner]
                for c in range(3):
                    z[c] += w * direction[node, c]
            for c in range(3):
                t[c] = slopes[n, c, 0] * x[0] + slopes[n, c, 1] * x[1] + slopes[n, c, 2] * x[2] + steep[n, c] * z[c]
            for c in range(3):
                x[c] = slopes[n, 0, c] * t[0] + slopes[n, 1, c] * t[1] + slopes[n, 2, c] * t[2] + hold[n] * x[c]
                z[c] = steep[n, c] * (t[c] + caution[n] * steep[n, c] * z[c])
            for corner in range(4):
                node, w = nodes[n, corner], weights[n, corner]
                for c in range(3):
                    total[node, c] += w * x[c]
            for corner in range(corners):
                node, w = render_nodes[n, corner], render_weights[n, corner]
                for c in range(3):
                    total[node, c] += w * z[c]


@compiled()
def add_smoothness(bands: Array, b: Array, total: Array) -> None:
    """Add the penalty of second differences along each axis."""
    size = b.shape[0]
    for i in range(size):
        for j in range(size):
            for k in range(size):
                for d in range(-2, 3):
                    for c in range(3):
                        if 0 <= i + d < size:
                            total[i, j, k, c] += bands[i, d + 2] * b[i + d, j, k, c]
                        if 0 <= j + d < size:
                            total[i, j, k, c] += bands[j, d + 2] * b[i, j + d, k, c]
                        if 0 <= k + d < size:
                            total[i, j, k, c] += bands[k, d + 2] * b[i, j, k + d, c]
