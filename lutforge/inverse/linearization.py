"""The linearization of a config: a lookup table JPEG → RAW that inverts a baked render.

First the RAW of JPEG colours from the whole cube is found exactly, colour by colour (`preimages`). Then a table is
fitted to these pairs by lattice regression. The inverse of the render's output curve comes before the table, which
therefore has to follow the render's lattice only. The residual of a colour is weighted by the slope of the render, so
that it has the size that it has in the rendered picture. Each further fit gives the largest errors of the last one more
weight (Lawson's algorithm, see `solvers/robust_weights.py`), which lowers the maximum. For colours that the render does
not make, the table continues smoothly.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from lutforge.arrays import Array
from lutforge.interpolation import Levels, apply_curve, interpolate
from lutforge.inverse.baked_render import BakedRender
from lutforge.inverse.preimages import clipped_sides, preimages
from lutforge.inverse.round_trip import in_every_cell, raw_colours
from lutforge.luts.ops import Cube
from lutforge.luts.sequence import Lut
from lutforge.luts.shaper import shaper
from lutforge.model.lattice import SHORT_SHAPER_SIZE, grid, snap_levels
from lutforge.solvers.lattice_regression import Prior, Regularization, fit_lattice

PRIOR_WEIGHT = 1e-5
"""Weight of the prior mean at a node; a colour that the render makes has 1. Colours of a lower weight are left out."""


INVERSE_SIZE = 49
"""Nodes per axis. A file of 49³ has 0.9 MB, one of 65³ has 2."""

ROUNDS = 2
"""The number of fits; each gives the largest errors of the one before more weight.

The second fit lowers the largest error of the round trip on the published D40 from 0.027 to 0.014. Five fits instead of
two have no consistent effect (D40 0.015; S40 0.018 to 0.038; demo 0.033 to 0.037; of four unseen cameras one 0.34 to
0.18, one 0.31 to 0.35, two unchanged).
"""

SMOOTHNESS = 1e-3
"""Weight of second differences; a colour has 1. With a hundredth of this weight the edge of the gamut shows ringing."""

MARGIN = 0.005
"""Distance of the lattice values of a clipped colour beyond the end of the output curve.

The RAW that is chosen for such a colour has this distance, so that the colour stays clipped between nodes. With four
times as much, the largest error of the demo's styles doubles.
"""

OUTSIDE = 8.0
"""Exponent of the weight of colours that the render cannot make.

Such a colour gets the RAW whose rendering is nearest to it. Its weight is the ratio of half a code to the distance of
the two, to this power. Without such colours the table leaves RAW 0 to 1 in the cells at the edge of the gamut, where
the render clamps, and hues change: the largest error is 0.056 instead of 0.015 on the D40 under fluorescent light. With
a power of 2 they distort small tables inside the gamut.
"""


@dataclass(frozen=True, eq=False)
class Linearization:
    """A curve per channel and a cube after it: JPEG (…, 3) → RAW.

    levels: node levels of the three axes, as JPEG values; curve: (m, 3), at m even steps of the JPEG value; between two
    nodes the cube is linear in the values of this curve. values: (N, N, N, 3), RAW at the nodes.
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


def inverse_of(render: BakedRender, near: Callable[[Array], Array], size: int = INVERSE_SIZE) -> Linearization:
    """The inverse of a render. It is deterministic, and takes O(n + N³) time.

    near: a function JPEG (…, 3) → RAW, which the table follows for colours that the render does not make. size: N nodes
    per axis.
    """
    levels = spaced_levels(render, size)
    knots = _on_axes(render.curve, levels)
    nodes = grid(levels)
    prior = Prior(near(nodes), np.full(nodes.shape, PRIOR_WEIGHT))
    smooth = Regularization(SMOOTHNESS, SMOOTHNESS)
    base = Linearization(levels, render.curve, prior.values)
    colours = in_every_cell(levels, np.random.default_rng(1))
    jpeg, raw, trust = _pairs(render, base, colours, levels[0][1])
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

        # Many RAW colours render to a clipped colour: the one near the table is taken. A search that led to a wrong RAW
        # is repeated from the table, too.
        again = clipped | ((error > 5e-3) & np.all(side == 0, axis=1))
        raw[again] = preimages(render, jpeg[again], reached[again], MARGIN)[0]
        slope[again] = render.slope(render.cube_values(raw[again]))
    assert best is not None
    return Linearization(levels, render.curve, best)


def spaced_levels(render: BakedRender, size: int) -> Levels:
    """Choose node levels on the shaper's grid: even steps of the JPEG (3/4) mixed with even steps of the lattice (1/4).

    The second and the last but one stand within half an 8-bit code of the ends, so that clipped codes have a layer of
    their own.
    """
    layer, axes = 8 / (SHORT_SHAPER_SIZE - 1), []
    even = np.linspace(0.0, 1.0, size - 2)
    for bent in apply_curve(render.output_curve, even[:, None].repeat(3, axis=1)).T:
        inside = np.clip(0.75 * even + 0.25 * bent, 1.5 * layer, 1 - 1.5 * layer)[1:-1]
        axes.append(snap_levels(np.concatenate([[0.0, layer], inside, [1 - layer, 1.0]]), SHORT_SHAPER_SIZE))
    return axes[0], axes[1], axes[2]


def _on_axes(curve: Array, levels: Levels) -> Levels:
    """Map node levels of the JPEG through a curve."""
    r, g, b = apply_curve(curve, np.stack(levels, axis=1)).T
    return np.ascontiguousarray(r), np.ascontiguousarray(g), np.ascontiguousarray(b)


def _pairs(render: BakedRender, base: Linearization, jpeg: Array, layer: float) -> tuple[Array, Array, Array]:
    """The JPEG colours (n, 3) that the render makes or nearly makes, their RAW (n, 3), and their weights (n,).

    layer: the distance of the second node level from the end of an axis.
    """
    # Colours that are not clipped. Where the search fails, it begins again at the RAW of the nearest colour.
    unclipped = np.clip(jpeg, layer, 1 - layer)
    raw, residual = preimages(render, unclipped, base(unclipped))
    not_found = np.flatnonzero(residual > 1e-3)
    scenes = raw_colours(4096, seed=5)
    near_scenes = scenes[scipy.spatial.cKDTree(render(scenes)).query(unclipped[not_found], workers=-1)[1]]
    raw[not_found], residual[not_found] = preimages(render, unclipped[not_found], near_scenes)

    # The search for a clipped colour begins at the RAW of the colour next to it that is not clipped, so that the
    # inverse continues smoothly where channels clip.
    clipped = np.flatnonzero(np.any(unclipped != jpeg, axis=1))
    raw[clipped], residual[clipped] = preimages(render, jpeg[clipped], raw[clipped], MARGIN)

    # White and black become neutral: white with the value of its brightest channel, black with that of its darkest.
    extremes = np.abs(clipped_sides(jpeg).sum(axis=1)) == 3
    brightest = raw[extremes].max(axis=1, keepdims=True)
    darkest = raw[extremes].min(axis=1, keepdims=True)
    neutral = np.where(jpeg[extremes] > 0, brightest, darkest)
    as_good = np.linalg.norm(render(neutral) - jpeg[extremes], axis=1) <= 2e-3
    raw[extremes] = np.where(as_good[:, None], neutral, raw[extremes])

    half_a_code = 3**0.5 * 0.5 / 255
    trust = (half_a_code / np.maximum(residual, half_a_code)) ** OUTSIDE
    has_weight = trust > PRIOR_WEIGHT
    return jpeg[has_weight], raw[has_weight], trust[has_weight]
