"""Which RAW a baked render makes a JPEG colour of: its exact inverse, colour by colour.

A baked render is a lattice and a curve per channel behind it, so its value and its slope at any RAW are known in closed
form, and Levenberg–Marquardt steps on them reach the RAW to rounding. A channel that is clipped says only that the
lattice is at or beyond the end of its curve there.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from lutforge.compiled import compiled
from lutforge.interpolation import locate, through
from lutforge.ocio.lattice_lut import LatticeLut as Lut
from lutforge.threads import run, slabs

Array = NDArray[np.float64]

CLIPPED = 1e-7
"""Of an end of the encoded range: as good as it."""
FOUND = 1e-3
"""Residual, encoded, up to which a RAW counts as one that makes the colour."""
STEPS = 40
BLOCK = 1024
"""Colours that a thread takes at once: some need many more steps than others."""
LEAST_SLOPE = 0.05
"""Of the curve, so that a flat part of it does not hide how far a lattice value is off."""


@dataclass(frozen=True, eq=False)
class Render:
    """A render LUT without gain, input curve and matrix: RAW (…, 3) → lattice → response → JPEG.

    levels: (3, N), in RAW, over at least [0, 1]; values: (N, N, N, 3); response: (m, 3), at m even steps of [0, 1],
    clamped.
    """

    lut: Lut
    levels: Array
    values: Array
    tetrahedral: bool
    response: Array

    def __call__(self, raw: Array) -> Array:
        """JPEG colours (n, 3), clamped to [0, 1] as a file holds them."""
        return np.clip(self.lut(raw), 0.0, 1.0)


def as_render(lut: Lut) -> Render:
    """The parts of a render LUT."""
    response = np.repeat([[0.0], [1.0]], 3, axis=1) if lut.response is None else lut.response
    levels = lut.lowest + (1 - lut.lowest) * np.stack(lut.knots)
    return Render(lut, levels, lut.cube, lut.interpolation == "tetrahedral", response)


def curve_inverse(response: Array, size: int) -> Array:
    """The inverse of a rising curve per channel at `size` even steps of [0, 1], (size, 3)."""
    even, at = np.linspace(0.0, 1.0, size), np.linspace(0.0, 1.0, len(response))
    columns = []
    for table in response.T:
        highest = np.maximum.accumulate(table)
        rising = np.concatenate([[True], np.diff(highest) > 1e-9])
        columns.append(np.interp(even, highest[rising], at[rising]))
    return np.stack(columns, axis=1)


def preimages(render: Render, inner: Array, jpeg: Array, start: Array) -> tuple[Array, NDArray[np.bool_]]:
    """RAW (n, 3) that the render takes to JPEG colours (n, 3), searched from `start` (n, 3), and which were found.

    inner: the same colours in front of the response. Where the start already makes the colour it is kept, even beyond
    the range of the lattice, where the camera clips; every other result is within it. O(n) time.
    """
    reach = 1e-3
    low, high = np.clip(inner - reach, 0.0, 1.0), np.clip(inner + reach, 0.0, 1.0)
    slope = np.maximum((through(render.response, high) - through(render.response, low)) / (high - low), LEAST_SLOPE)
    side = clipped_sides(jpeg)
    raw = np.ascontiguousarray(start).copy()
    left = np.empty(len(raw))
    search = partial(_search, render.values, render.levels, render.tetrahedral, inner, slope, side, raw, left)
    run(search, slabs(0, len(raw), BLOCK, len(raw)))
    return raw, left <= FOUND


def clipped_sides(jpeg: Array) -> NDArray[np.int64]:
    """Where channels of JPEG colours (n, 3) are clipped: 1 at white, −1 at black, else 0."""
    return np.where(jpeg >= 1 - CLIPPED, 1, np.where(jpeg <= CLIPPED, -1, 0)).astype(np.int64)


@compiled()
def falling_axes(fraction: Array) -> tuple[int, int, int]:
    """The axes in falling order of the fractions (3,) along them: the way through a cell from tetrahedron to corner."""
    a, b, d = 0, 1, 2  # axes in falling order of their fractions
    if fraction[a] < fraction[b]:
        a, b = b, a
    if fraction[b] < fraction[d]:
        b, d = d, b
    if fraction[a] < fraction[b]:
        a, b = b, a
    return a, b, d


@compiled()
def value_and_slope(values: Array, levels: Array, tetrahedral: bool, x: Array, y: Array, slope: Array) -> None:
    """Fill y (3,) and slope (3, 3), d y / d x, of a lattice at x (3,) within its levels."""
    cell, fraction, width = np.empty(3, dtype=np.int64), np.empty(3), np.empty(3)
    for c in range(3):
        cell[c], fraction[c] = locate(levels[c], x[c])
        width[c] = levels[c, cell[c] + 1] - levels[c, cell[c]]
    if tetrahedral:
        i, j, k = cell[0], cell[1], cell[2]
        for c in range(3):
            y[c] = values[i, j, k, c]
        for axis in falling_axes(fraction):
            p, q, r = i + (axis == 0), j + (axis == 1), k + (axis == 2)
            for c in range(3):
                step = values[p, q, r, c] - values[i, j, k, c]
                y[c] += step * fraction[axis]
                slope[c, axis] = step / width[axis]
            i, j, k = p, q, r
        return
    y[:] = 0.0
    slope[:] = 0.0
    for corner in range(8):
        p, q, r = corner >> 2, (corner >> 1) & 1, corner & 1
        wp = fraction[0] if p else 1 - fraction[0]
        wq = fraction[1] if q else 1 - fraction[1]
        wr = fraction[2] if r else 1 - fraction[2]
        for c in range(3):
            v = values[cell[0] + p, cell[1] + q, cell[2] + r, c]
            y[c] += wp * wq * wr * v
            slope[c, 0] += (2 * p - 1) * wq * wr * v / width[0]
            slope[c, 1] += (2 * q - 1) * wp * wr * v / width[1]
            slope[c, 2] += (2 * r - 1) * wp * wq * v / width[2]


@compiled()
def _left(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    x: Array,
    target: Array,
    weight: Array,
    side: NDArray[np.int64],
    left: Array,
    slope: Array,
) -> float:
    """What is left of the target at x, times the weight, and its squared norm; 0 where a clipped channel is beyond."""
    y = np.empty(3)
    value_and_slope(values, levels, tetrahedral, x, y, slope)
    total = 0.0
    for c in range(3):
        left[c] = weight[c] * (target[c] - y[c])
        if side[c] * left[c] < 0:
            left[c] = 0.0
            slope[c] = 0.0
        slope[c] *= weight[c]
        total += left[c] * left[c]
    return total


@compiled()
def _normal(slope: Array, left: Array, x: Array, levels: Array, gradient: Array, square: Array) -> None:
    """J'r into gradient and J'J into square, without the axes of x that are at an end and drawn beyond it."""
    for axis in range(3):
        pull = 0.0
        for c in range(3):
            pull += slope[c, axis] * left[c]
        stays = (x[axis] <= levels[axis, 0] and pull < 0) or (x[axis] >= levels[axis, -1] and pull > 0)
        gradient[axis] = 0.0 if stays else pull
        if stays:
            slope[:, axis] = 0.0
    for p in range(3):
        for q in range(p + 1):
            total = 0.0
            for c in range(3):
                total += slope[c, p] * slope[c, q]
            square[p, q] = total


@compiled()
def _moved(square: Array, gradient: Array, x: Array, levels: Array, trial: Array) -> None:
    """x + square⁻¹ gradient within the lattice, into trial; square: (3, 3), lower half, positive (Cholesky)."""
    a = np.sqrt(square[0, 0])
    b, d = square[1, 0] / a, square[2, 0] / a
    e = np.sqrt(max(square[1, 1] - b * b, 1e-300))
    f = (square[2, 1] - d * b) / e
    g = max(square[2, 2] - d * d - f * f, 1e-300)
    u = gradient[0] / a
    v = (gradient[1] - b * u) / e
    z = (gradient[2] - d * u - f * v) / g
    y = (v - f * z) / e
    trial[0], trial[1], trial[2] = x[0] + (u - b * y - d * z) / a, x[1] + y, x[2] + z
    for axis in range(3):
        trial[axis] = min(max(trial[axis], levels[axis, 0]), levels[axis, -1])


@compiled()
def _search(
    values: Array,
    levels: Array,
    tetrahedral: bool,
    targets: Array,
    weights: Array,
    sides: NDArray[np.int64],
    raw: Array,
    remains: Array,
    first: int,
    last: int,
) -> None:
    """Levenberg–Marquardt within the lattice for some of the targets, in place; remains: what is left of each (n,)."""
    x, trial, gradient, square = np.empty(3), np.empty(3), np.empty(3), np.empty((3, 3))
    left, other, slope, steep = np.empty(3), np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    for n in range(first, last):
        for c in range(3):
            x[c] = min(max(raw[n, c], levels[c, 0]), levels[c, -1])
        target, weight, side = targets[n], weights[n], sides[n]
        cost = _left(values, levels, tetrahedral, x, target, weight, side, left, slope)
        damping, moved = 1e-4, False
        for _ in range(STEPS):
            if cost < 1e-12:
                break
            _normal(slope, left, x, levels, gradient, square)
            scale = (square[0, 0] + square[1, 1] + square[2, 2]) / 3
            better = False
            for _ in range(8):
                for axis in range(3):
                    square[axis, axis] += damping * scale + 1e-12
                _moved(square, gradient, x, levels, trial)
                reached = _left(values, levels, tetrahedral, trial, target, weight, side, other, steep)
                if reached < cost:
                    better = True
                    break
                damping *= 8
            if not better:
                break
            cost, moved = reached, True
            x[:], left[:], slope[:] = trial, other, steep
            damping *= 0.1
        if moved:
            raw[n] = x
        remains[n] = np.sqrt(cost)
