"""The lookup table JPEG → RAW that undoes a baked render: how a config's linearization is made.

Colours from the whole cube of JPEG values are inverted exactly, one by one (`preimages`), and the table is fitted to
the RAW found for them by lattice regression, behind the inverse of the render's output curve, so that only the bends of
the render's lattice are left to it. Errors count as the render shows them. From fit to fit the largest errors count
more (Lawson's algorithm, see `solvers/robust_weights.py`), which brings the maximum down. Beyond the colours that the
render makes the table continues smoothly.
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
"""Weight of the prior mean at a node, where a colour that the render makes has 1. Colours of less are left out."""


INVERSE_SIZE = 49
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


def inverse_of(render: BakedRender, near: Callable[[Array], Array], size: int = INVERSE_SIZE) -> Linearization:
    """The inverse of a render. The same render makes the same table. O(n + N³) time.

    near: a function JPEG (…, 3) → RAW, followed beyond the colours that the render makes. size: N nodes per axis.
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
    """Choose the JPEG colours (n, 3) that the render makes or comes near to, the RAW for them, and their weights (n,).

    Clipped colours are sought from the scenes of those that are just not clipped, so that the inverse runs on smoothly
    where channels clip. White is as bright as its brightest channel then is, and neutral, as is black.
    """
    just = np.clip(jpeg, layer, 1 - layer)
    raw, residual = preimages(render, just, base(just))
    lost = np.flatnonzero(residual > 1e-3)  # the search begins again at the scene of the nearest colour
    scenes = raw_colours(4096, seed=5)
    near_scenes = scenes[scipy.spatial.cKDTree(render(scenes)).query(just[lost], workers=-1)[1]]
    raw[lost], residual[lost] = preimages(render, just[lost], near_scenes)
    clipped = np.flatnonzero(np.any(just != jpeg, axis=1))
    raw[clipped], residual[clipped] = preimages(render, jpeg[clipped], raw[clipped], MARGIN)
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
