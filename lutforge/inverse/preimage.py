"""Find the RAW that a baked render takes to a JPEG colour, colour by colour.

A baked render is a lattice with a curve per channel behind it, so its value and its slope at any RAW are known in
closed form, and Levenberg–Marquardt steps (Nocedal & Wright, Numerical Optimization, 2006, section 10.3) reach the RAW
to rounding. A channel that is clipped says only that the lattice is at or beyond the end of its curve.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import locate
from lutforge.inverse.baked_render import BakedRender
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.threads import each, slabs


def clipped_sides(jpeg: Array) -> Index:
    """Tell where channels of JPEG colours (n, 3) are clipped: 1 at white, −1 at black, else 0."""
    return np.where(jpeg >= 1 - 1e-7, 1, np.where(jpeg <= 1e-7, -1, 0)).astype(np.int64)


def preimages(render: BakedRender, jpeg: Array, start: Array, margin: float = 0.0) -> tuple[Array, Array]:
    """RAW (n, 3) that the render takes to JPEG colours (n, 3), searched from `start` (n, 3) within the RAW range.

    Of all scenes of a clipped colour it is one near the start, with the lattice `margin` beyond the end of its curve
    where that costs the other channels nothing. Also returned: the residual that is left, encoded (n,), 0 to rounding
    where the render makes the colour at all. O(n) time.
    """
    lattice_values, sides, levels = render.to_values(jpeg), clipped_sides(jpeg), np.stack(render.levels)
    weights, raw = render.slope(lattice_values), np.empty(jpeg.shape)

    def search(part: tuple[int, int]) -> None:
        rows = slice(*part)

        def linearize(raw: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
            residual, slope, at = np.empty(raw.shape), np.empty((*raw.shape, 3)), rows.start + which
            _residual_and_slope(
                render.values, levels, render.tetrahedral, raw, lattice_values[at], weights[at], sides[at], margin,
                residual, slope,
            )  # fmt: skip
            return residual, slope

        raw[rows] = gauss_newton(linearize, start[rows], lower=levels[:, 0], upper=levels[:, -1]).value

    at_once = 8192  # colours whose slopes stay in a core's cache
    for _ in each(search, slabs(0, len(jpeg), 1, -(-len(jpeg) // at_once))):
        pass
    return raw, np.linalg.norm(render(raw) - jpeg, axis=1)


@compiled()
def _falling_axes(fraction: Array) -> tuple[int, int, int]:
    """The axes in falling order of the fractions (3,) along them: the way through a cell from its low corner."""
    a, b, c = 0, 1, 2
    if fraction[a] < fraction[b]:
        a, b = b, a
    if fraction[b] < fraction[c]:
        b, c = c, b
    if fraction[a] < fraction[b]:
        a, b = b, a
    return a, b, c


@compiled()
def _value_and_slope(values: Array, levels: Array, tetrahedral: bool, x: Array, y: Array, slope: Array) -> None:
    """Fill y (3,) and slope (3, 3), d y / d x, of a lattice at x (3,) within its levels."""
    cell, fraction, width = np.empty(3, dtype=np.int64), np.empty(3), np.empty(3)
    for c in range(3):
        cell[c], fraction[c] = locate(levels[c], x[c])
        width[c] = levels[c, cell[c] + 1] - levels[c, cell[c]]
    if tetrahedral:
        i, j, k = cell[0], cell[1], cell[2]
        for c in range(3):
            y[c] = values[i, j, k, c]
        for axis in _falling_axes(fraction):
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
def _residual_and_slope(
    values: Array, levels: Array, tetrahedral: bool, raw: Array, targets: Array, weights: Array, sides: Index,
    margin: float, residual: Array, slope: Array,
) -> None:  # fmt: skip
    """Fill residual (n, 3) and its slope (n, 3, 3) at raw (n, 3), both encoded.

    A clipped channel is drawn to the end of the curve with full weight, and beyond it by `margin` with a fiftieth.
    """
    y = np.empty(3)
    for n in range(len(raw)):
        _value_and_slope(values, levels, tetrahedral, raw[n], y, slope[n])
        for c in range(3):
            side, scale = sides[n, c], weights[n, c]
            error = y[c] - targets[n, c]
            residual[n, c] = scale * error
            if side != 0 and side * error < 0.0:
                residual[n, c] -= 0.02 * side * margin
            elif side != 0:
                residual[n, c] = 0.02 * side * min(side * error - margin, 0.0)
                scale = 0.02 if side * error < margin else 0.0
            for axis in range(3):
                slope[n, c, axis] *= scale
