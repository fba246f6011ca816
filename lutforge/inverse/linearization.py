"""The lookup table JPEG → RAW that undoes a baked render: how a config's linearization is made.

Colours from the whole cube of JPEG values are inverted exactly, one by one (`preimages`), and the table is fitted to
the RAW found for them by lattice regression, behind the inverse of the render's output curve, so that only the bends of
the render's lattice are left to it. Errors count as the render shows them. From fit to fit the largest errors count
more (Lawson's algorithm, see `solvers/robust_weights.py`), which brings the maximum down. Beyond the colours that the
render makes the table continues smoothly.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array, Index
from lutforge.compiled import compiled
from lutforge.errors import LutError
from lutforge.interpolation import Axis, Levels, apply_curve, indexed, interpolate, locate
from lutforge.inverse.round_trip import in_every_cell, raw_colours
from lutforge.luts.ops import Cube, Curve, Range
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import node_levels, shaper
from lutforge.model.lattice import Lattice, grid, snap_levels
from lutforge.solvers.gauss_newton import gauss_newton
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice
from lutforge.threads import each, slabs


class BakedRender(Lattice):
    """RAW (…, 3) → lattice → output curve → JPEG, as the file of a render evaluates it."""

    output_curve: Array

    @classmethod
    def of(cls, lut: Lut) -> "BakedRender":
        """The parts of a render LUT: node levels, a cube, an output curve. Raises LutError on any other sequence."""
        ops = [op for op in lut.ops if not isinstance(op, Range)]
        if isinstance(ops[-1], Cube):
            ops.append(Curve(np.repeat([[0.0], [1.0]], 3, axis=1)))
        match ops:
            case [Cube() as cube, Curve() as output_curve]:
                levels = node_levels(None, cube)
            case [Curve() as front, Cube() as cube, Curve() as output_curve] if _only_spreads(front, cube):
                levels = node_levels(front, cube)
            case _:
                raise LutError(f"a render is node levels, a cube and a curve, not {lut.summary}")
        return cls(levels, cube.values, cube.interpolation, output_curve.outputs)

    def __call__(self, raw: ArrayLike) -> Array:
        """JPEG colours of RAW (…, 3), clamped to [0, 1] as a file holds them."""
        return np.clip(super().__call__(raw), 0.0, 1.0)

    def to_values(self, jpeg: Array) -> Array:
        """Return the lattice values in [0, 1] that the output curve takes to JPEG colours (…, 3)."""
        return apply_curve(self.curve, jpeg)

    def slope(self, lattice_values: Array) -> Array:
        """Return the slope of the output curve at lattice values (…, 3), at least 0.05, so that every error counts."""
        return np.maximum(apply_curve(self._slopes, lattice_values), 0.05)

    @cached_property
    def curve(self) -> Array:
        """The inverse of the output curve at 4096 even steps of the JPEG value, (4096, 3)."""
        even, at = np.linspace(0.0, 1.0, 4096), np.linspace(0.0, 1.0, len(self.output_curve))
        columns = []
        for table in self.output_curve.T:
            rising = np.concatenate([[True], np.diff(table) > 1e-9])
            columns.append(np.interp(even, table[rising], at[rising]))
        return np.stack(columns, axis=1)

    @cached_property
    def _slopes(self) -> Array:
        """Slopes of the output curve over the width of half a code, at even steps."""
        x = np.linspace(0.0, 1.0, 1024)[:, None].repeat(3, axis=1)
        low, high = np.clip(x - 1e-3, 0.0, 1.0), np.clip(x + 1e-3, 0.0, 1.0)
        return np.asarray((apply_curve(self.output_curve, high) - apply_curve(self.output_curve, low)) / (high - low))


def _only_spreads(front: Curve, cube: Cube) -> bool:
    """True where a curve takes node levels to even steps and runs straight between them, to a sixtieth of a cell."""
    at, levels = np.linspace(front.low, front.high, len(front.outputs)), node_levels(front, cube)
    straight = [np.interp(at, axis, np.linspace(0.0, 1.0, len(axis))) for axis in levels]
    return front.inputs is None and np.abs(np.stack(straight, axis=1) - front.outputs).max() * cube.size < 1 / 60


PRIOR_WEIGHT = 1e-5
"""Weight of the prior mean at a node, where a colour that the render makes has 1. Colours of less are left out."""


SIZE = 49
"""Nodes per axis. A file of 49³ has 0.9 MB, one of 65³ has 2."""

ROUNDS = 2
"""The number of fits; each gives the largest errors of the one before more weight.

The second takes the largest loss on the published D40 from 0.027 to 0.014. Five instead of two change it at random (D40
0.015, S40 0.018 to 0.038, demo 0.033 to 0.037; of four unseen cameras 0.34 to 0.18, 0.31 to 0.35, two alike).
"""

SMOOTHNESS = 1e-3
"""Weight of second differences, where a colour has 1. With a hundredth of it the edge of the gamut shows ringing."""

MARGIN = 0.005
"""How far beyond the end of the output curve the lattice values of a clipped colour's scene lie.

So it stays clipped between nodes. With four times as much the largest loss of the demo's styles doubles.
"""

OUTSIDE = 8.0
"""A colour that the render cannot make is given the scene whose colour is nearest, with a weight.

It is the ratio of half a code to the distance of that colour, to this power. Without such colours the table leaves RAW
0 to 1 in the cells at the edge of the gamut, where the render clamps, and hues change: the largest loss is 0.056
instead of 0.015 on the D40 under fluorescent light. With a power of 2 they distort small tables inside the gamut.
"""

ENTRIES = 4096
"""Entries of the shaper that holds the node levels."""


@dataclass(frozen=True, eq=False)
class Linearization:
    """A cube that takes JPEG (…, 3) to RAW.

    levels: of the JPEG, three axes; curve: (m, 3), in front of the cube, which is linear on it between nodes; values:
    (N, N, N, 3).
    """

    levels: Levels
    curve: Array
    values: Array

    def __call__(self, jpeg: Array) -> Array:
        """RAW of JPEG colours (…, 3)."""
        return interpolate(apply_curve(self.curve, jpeg), _on_axes(self.curve, self.levels), self.values, "tetrahedral")

    def as_lut(self, title: str = "") -> Lut:
        """Return the linearization as a shaper and a cube."""
        return Lut((shaper(self.levels, len(self.curve), self.curve), Cube(self.values)), title)


def inverse_of(render: BakedRender, near: Callable[[Array], Array], size: int = SIZE) -> Linearization:
    """The inverse of a render. The same render makes the same table. O(n + N³) time.

    near: a function JPEG (…, 3) → RAW, followed beyond the colours that the render makes. size: N nodes per axis.
    """
    levels = spaced_levels(render, size)
    knots = _on_axes(render.curve, levels)
    nodes = grid(levels)
    prior = Prior(near(nodes), np.full(nodes.shape, PRIOR_WEIGHT))
    smooth = Regularization(SMOOTHNESS, SMOOTHNESS)
    known = Linearization(levels, render.curve, prior.values)
    colours = in_every_cell(levels, np.random.default_rng(1))
    jpeg, raw, trust = _pairs(render, known, colours, levels[0][1])
    lattice_values, side = render.to_values(jpeg), clipped_sides(jpeg)
    clipped = np.any(side != 0, axis=1) & (np.abs(side.sum(axis=1)) < 3)
    slope = render.slope(render.cube_values(raw))
    lawson_weight, values, best, least = np.ones(len(jpeg)), None, None, np.inf
    for remaining in reversed(range(ROUNDS)):
        weight = trust * lawson_weight * np.einsum("nc,nc->n", slope, slope)
        values = fit_lattice(
            lattice_values, raw, knots, smooth, method="tetrahedral", weight=weight / weight.mean(), prior=prior,
            start=values, tolerance=1e-5,
        ).value  # fmt: skip
        reached = interpolate(lattice_values, knots, values, "tetrahedral")
        error = trust * np.linalg.norm(render(reached) - jpeg, axis=1)
        if error.max() < least:
            best, least = values, float(error.max())
        if remaining == 0:
            break
        lawson_weight = lawson_weight * (error + 2e-3)  # half a code: smaller errors do not matter
        lawson_weight = np.minimum(lawson_weight / lawson_weight.mean(), 1e3)
        again = clipped | ((error > 5e-3) & np.all(side == 0, axis=1))
        # Many RAW colours render to a clipped one: take the one near the table. The same where a search went astray.
        raw[again] = preimages(render, jpeg[again], reached[again], MARGIN)[0]
        slope[again] = render.slope(render.cube_values(raw[again]))
    assert best is not None
    return Linearization(levels, render.curve, best)


def spaced_levels(render: BakedRender, size: int) -> Levels:
    """Choose node levels on the shaper's grid: even steps of the JPEG (3/4) mixed with even steps of the lattice (1/4).

    The second and the last but one stand within half an 8-bit code of the ends, so that clipped codes have a layer of
    their own.
    """
    layer, axes = 8 / (ENTRIES - 1), []
    even = np.linspace(0.0, 1.0, size - 2)
    for bent in apply_curve(render.output_curve, even[:, None].repeat(3, axis=1)).T:
        inside = np.clip(0.75 * even + 0.25 * bent, 1.5 * layer, 1 - 1.5 * layer)[1:-1]
        axes.append(snap_levels(np.concatenate([[0.0, layer], inside, [1 - layer, 1.0]]), ENTRIES))
    return axes[0], axes[1], axes[2]


def _on_axes(curve: Array, levels: Levels) -> Levels:
    """Map node levels of the JPEG through a curve."""
    r, g, b = apply_curve(curve, np.stack(levels, axis=1)).T
    return np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b)


def _pairs(render: BakedRender, known: Linearization, jpeg: Array, layer: float) -> tuple[Array, Array, Array]:
    """Choose the JPEG colours (n, 3) that the render makes or comes near to, the RAW for them, and their weights (n,).

    Clipped colours are sought from the scenes of those that are just not clipped, so that the inverse runs on smoothly
    where channels clip. White is as bright as its brightest channel then is, and neutral, as is black.
    """
    just = np.clip(jpeg, layer, 1 - layer)
    raw, residual = preimages(render, just, known(just))
    lost = np.flatnonzero(residual > 1e-3)  # the search begins again at the scene of a colour beside
    scenes = raw_colours(4096, seed=5)
    beside = scenes[scipy.spatial.cKDTree(render(scenes)).query(just[lost], workers=-1)[1]]
    raw[lost], residual[lost] = preimages(render, just[lost], beside)
    clipped = np.flatnonzero(np.any(just != jpeg, axis=1))
    raw[clipped], residual[clipped] = preimages(render, jpeg[clipped], raw[clipped], MARGIN)
    ends = np.abs(clipped_sides(jpeg).sum(axis=1)) == 3
    neutral = np.where(jpeg[ends] > 0, raw[ends].max(axis=1, keepdims=True), raw[ends].min(axis=1, keepdims=True))
    as_good = np.linalg.norm(render(neutral) - jpeg[ends], axis=1) <= 2e-3
    raw[ends] = np.where(as_good[:, None], neutral, raw[ends])
    half_a_code = 3**0.5 * 0.5 / 255
    trust = (half_a_code / np.maximum(residual, half_a_code)) ** OUTSIDE
    told = trust > PRIOR_WEIGHT
    return jpeg[told], raw[told], trust[told]


# --- The RAW that a baked render takes to a JPEG colour, colour by colour --------------------------------------------
# A baked render is a lattice with a curve per channel behind it, so its value and its slope at any RAW are known in
# closed form, and Levenberg–Marquardt steps (Nocedal & Wright, Numerical Optimization, 2006, section 10.3) reach the
# RAW to rounding. A channel that is clipped says only that the lattice is at or beyond the end of its curve.


def clipped_sides(jpeg: Array) -> Index:
    """Tell where channels of JPEG colours (n, 3) are clipped: 1 at white, −1 at black, else 0."""
    return np.where(jpeg >= 1 - 1e-7, 1, np.where(jpeg <= 1e-7, -1, 0)).astype(np.int64)


def preimages(render: BakedRender, jpeg: Array, start: Array, margin: float = 0.0) -> tuple[Array, Array]:
    """RAW (n, 3) that the render takes to JPEG colours (n, 3), searched from `start` (n, 3) within the RAW range.

    Of all scenes of a clipped colour it is one near the start, with the lattice `margin` beyond the end of its curve
    where that costs the other channels nothing. Also returned: the residual that is left, encoded (n,), 0 to rounding
    where the render makes the colour at all. O(n) time.
    """
    lattice_values, sides, axes = render.to_values(jpeg), clipped_sides(jpeg), indexed(render.levels)
    ends = np.array([axis[[0, -1]] for axis in render.levels])
    weights, raw = render.slope(lattice_values), np.empty(jpeg.shape)

    def search(part: tuple[int, int]) -> None:
        rows = slice(*part)

        def linearize(raw: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
            residual, slope = np.empty(raw.shape), np.empty((*raw.shape, 3))
            _residual_and_slope(
                render.values, axes, render.interpolation == "tetrahedral", raw, rows.start + which, lattice_values,
                weights, sides, margin, residual, slope,
            )  # fmt: skip
            return residual, slope

        raw[rows] = gauss_newton(linearize, start[rows], lower=ends[:, 0], upper=ends[:, 1]).value

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
        # The axes in falling order of the fractions along them: the way through a cell from its low corner.
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
