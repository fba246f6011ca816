"""The preimages of JPEG colours under a baked render: for each colour a RAW that renders to it.

A baked render is a lattice followed by a curve per channel, so that its value and its slope at any RAW are known in
closed form. Levenberg–Marquardt steps (Nocedal & Wright, Numerical Optimization, 2006, section 10.3) find the RAW
within rounding errors. A clipped channel only shows that the lattice value is at the end of its curve or beyond.
"""

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.interpolation import Axis, indexed, locate
from lutforge.inverse.baked_render import BakedRender
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.threads import each, slabs


def clipped_sides(jpeg: Array) -> Index:
    """The end at which each channel of JPEG colours (n, 3) is clipped: 1 for white, −1 for black, 0 for neither."""
    return np.where(jpeg >= 1 - 1e-7, 1, np.where(jpeg <= 1e-7, -1, 0)).astype(np.int64)


def preimages(render: BakedRender, jpeg: Array, start: Array, margin: float = 0.0) -> tuple[Array, Array]:
    """RAW (n, 3) that renders to JPEG colours (n, 3), searched from `start` (n, 3) within the RAW range.

    Many RAW colours render to a clipped colour. The one that is found is near the start, and its lattice value is
    `margin` beyond the end of the curve, as far as that does not change the other channels. Also returned is the
    remaining residual (n,), encoded: 0 up to rounding for a colour that the render makes. O(n) time.
    """
    lattice_values, sides, axes = render.to_values(jpeg), clipped_sides(jpeg), indexed(render.levels)
    axis_ends = np.array([axis[[0, -1]] for axis in render.levels])
    matrix = render.input_matrix
    weights, raw = render.slope(lattice_values), np.empty(jpeg.shape)

    def search(part: tuple[int, int]) -> None:
        rows = slice(*part)

        def linearize(raw: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
            residual, slope = np.empty(raw.shape), np.empty((*raw.shape, 3))
            places = render.on_axes(raw)
            within = np.clip(places, axis_ends[:, 0], axis_ends[:, 1])
            _residual_and_slope(
                render.values, axes, render.interpolation == "tetrahedral", within, rows.start + which, lattice_values,
                weights, sides, margin, residual, slope,
            )  # fmt: skip
            if matrix is not None:  # beyond the ends of the axes the slope is 0
                slope = (slope * (places == within)[:, None, :]) @ matrix[:, :3]
            return residual, slope

        # RAW is limited by the ends of the axes, or by the sensor's where these are linear values.
        lower, upper = (axis_ends[:, 0], axis_ends[:, 1]) if matrix is None else (0.0, 1.0)
        raw[rows] = gauss_newton(linearize, start[rows], lower=lower, upper=upper).value

    at_once = 8192  # colours whose slopes stay in a core's cache
    for _ in each(search, slabs(0, len(jpeg), 1, -(-len(jpeg) // at_once))):
        pass
    return raw, np.linalg.norm(render(raw) - jpeg, axis=1)


@compiled()
def _value_and_slope(
    values: Array, axes: tuple[Axis, Axis, Axis], tetrahedral: bool, x: Array, y: Array, slope: Array
) -> None:
    """Fill y (3,) and slope (3, 3), d y / d x, of a lattice at x (3,) within its axes."""
    i, r = locate(axes[0], x[0])
    j, g = locate(axes[1], x[1])
    k, b = locate(axes[2], x[2])
    r_levels, g_levels, b_levels = axes[0].levels, axes[1].levels, axes[2].levels
    per_r, per_g = 1.0 / (r_levels[i + 1] - r_levels[i]), 1.0 / (g_levels[j + 1] - g_levels[j])
    per_b = 1.0 / (b_levels[k + 1] - b_levels[k])
    if tetrahedral:
        fractions, per_width = (r, g, b), (per_r, per_g, per_b)
        for c in range(3):
            y[c] = values[i, j, k, c]
        # The axes in falling order of their fractions: the path through the cell from its lowest corner.
        if r >= g:
            order = (0, 1, 2) if g >= b else (0, 2, 1) if r >= b else (2, 0, 1)
        else:
            order = (2, 1, 0) if b > g else (1, 2, 0) if b > r else (1, 0, 2)
        for axis in order:
            p, q, s = i + (axis == 0), j + (axis == 1), k + (axis == 2)
            for c in range(3):
                step = values[p, q, s, c] - values[i, j, k, c]
                y[c] += step * fractions[axis]
                slope[c, axis] = step * per_width[axis]
            i, j, k = p, q, s
        return
    y[:], slope[:] = 0.0, 0.0
    for corner in range(8):
        p, q, s = corner >> 2, (corner >> 1) & 1, corner & 1
        of_r, of_g, of_b = r if p else 1.0 - r, g if q else 1.0 - g, b if s else 1.0 - b
        for c in range(3):
            value = values[i + p, j + q, k + s, c]
            y[c] += of_r * of_g * of_b * value
            slope[c, 0] += (per_r if p else -per_r) * of_g * of_b * value
            slope[c, 1] += (per_g if q else -per_g) * of_r * of_b * value
            slope[c, 2] += (per_b if s else -per_b) * of_r * of_g * value


@compiled()
def _residual_and_slope(
    values: Array, axes: tuple[Axis, Axis, Axis], tetrahedral: bool, raw: Array, which: Index, targets: Array,
    weights: Array, sides: Index, margin: float, residual: Array, slope: Array,
) -> None:  # fmt: skip
    """Fill residual (a, 3) and its slope (a, 3, 3) of the colours `which` (a,) at raw (a, 3), both encoded.

    The residual of a clipped channel is its distance to the end of the curve, with full weight, and its distance to a
    point `margin` beyond the end, with a fiftieth of the weight.
    """
    y = np.empty(3)
    for n in range(len(raw)):
        _value_and_slope(values, axes, tetrahedral, raw[n], y, slope[n])
        for c in range(3):
            side, scale = sides[which[n], c], weights[which[n], c]
            error = y[c] - targets[which[n], c]
            residual[n, c] = scale * error
            if side != 0 and side * error < 0.0:
                residual[n, c] -= 0.02 * side * margin
            elif side != 0:
                residual[n, c] = 0.02 * side * min(side * error - margin, 0.0)
                scale = 0.02 if side * error < margin else 0.0
            for axis in range(3):
                slope[n, c, axis] *= scale
