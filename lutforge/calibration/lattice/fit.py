"""The lattice of chapter 5 as the fast form of a fitted camera model, at nodes where that bends.

The model is known everywhere, so that nothing is smoothed. What there is to choose is the nodes: they are placed where
interpolation between them errs most on likely scenes, in rounds that spread the squared error evenly (5.6 – 5.9 of the
thesis; de Boor 1973 for the exponent). Node values are then the least squares on these scenes, which halves the error
of sampled ones.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.node_levels import EVEN, equidistributed_levels, even_to_the_eye
from lutforge.calibration.lattice.output_curve import output_curve
from lutforge.calibration.options import LatticeOptions
from lutforge.calibration.scenes import RenderedScenes
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate
from lutforge.model.gamut_map import OFFSET, from_even
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice, grid, resized_levels, snapped, uniform_levels
from lutforge.model.profile import CameraModel
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.normal_equations import normal_equations

SEARCH_SIZE = 13
"""Nodes per axis of the lattice on which levels are searched: the best ones hardly depend on their number."""
HOLD = 1.0
"""The weight of the model's own value at a node, which keeps nodes with few colours around them where they belong."""


def bake_render(model: CameraModel, scenes: RenderedScenes, options: LatticeOptions) -> Lattice:
    """Bake the rendering of a camera model: white-balanced RAW → JPEG, with an output curve behind the cube.

    Errors count behind the curve.
    """
    curve = output_curve(model.response)
    values = curve.continued(scenes.mapped)
    # How much a squared error in front of the curve counts behind it, 1 in the median.
    codes = np.linspace(0.0, 1.0, 511)[:, None].repeat(3, axis=1)
    counts = squares(apply_curve(curve.slope(codes), apply_curve(curve.table, values)))
    weight = scenes.weight * (counts / np.median(counts))

    def before_the_curve(balanced: Array) -> Array:
        return curve.continued(model.gamut_map(balanced @ model.matrix.T))

    task = _Task(scenes.balanced, values, weight, options.interpolation)
    if not options.nonuniform:
        levels = uniform_levels(options.size)
    else:
        # A tenth of the nodes is at perceptually uniform steps: bright samples alone would make the first cell so wide
        # that it holds all dark codes of usual pictures.
        floor = EVEN + even_to_the_eye(0.1, OFFSET)
        start = from_even(np.linspace(0.0, 1.0, min(SEARCH_SIZE, options.size)), OFFSET)
        levels = task.best_levels(before_the_curve, start, floor, options)
    nodes, _ = task.fitted(before_the_curve, snapped(levels, options.shaper_size))
    return Lattice(snapped(levels, options.shaper_size), nodes, options.interpolation, curve.table)


def bake_linearize(model: CameraModel, scenes: RenderedScenes, options: LatticeOptions) -> Lattice:
    """Bake the inverse of a camera model: JPEG → white-balanced RAW.

    A camera maps wide ranges of RAW to few codes. So the lattice is the least squares on likely scenes, which comes
    near to their mean given the code. Where there are none, it follows the inverse that is solved.
    """
    whole = scenes.whole
    task = _Task(scenes.codes[whole], scenes.balanced[whole], scenes.weight[whole], options.interpolation)
    to_balanced = np.linalg.inv(model.matrix).T
    inverse = model.inverse_gamut_map
    start = inverse.start if isinstance(inverse, SolvedInverse) else inverse

    def likely(codes: Array) -> Array:
        return start(model.response.linearize(codes)) @ to_balanced

    levels = uniform_levels(options.size)
    if options.nonuniform:
        even = np.linspace(0.0, 1.0, min(SEARCH_SIZE, options.size))
        levels = task.best_levels(likely, even, EVEN, options)
    levels = snapped(levels, options.shaper_size)

    nodes, _ = task.fitted(model.linearize, levels)
    return Lattice(levels, nodes, options.interpolation)


@dataclass(frozen=True, eq=False)
class _Task:
    """What a lattice is fitted to: points in [0, 1] and values, both (m, 3), and weights (m,)."""

    points: Array
    values: Array
    weight: Array
    interpolation: Interpolation

    def best_levels(
        self, function: Callable[[Array], Array], start: Array, floor: Array, options: LatticeOptions
    ) -> Levels:
        """Node levels in rounds, each from the errors between the nodes of the one before; the last of a whole lattice.

        start: (k,), of the first round; floor: (BINS,), the density of nodes that stay whatever the errors.
        """
        levels: Levels = (start, start, start)
        best, least = levels, np.inf
        for _ in range(6):
            # The lattice of these rounds is small, and its nodes are sampled: the best levels hardly depend on either.
            sampled = function(grid(levels))
            error = self._error(levels, sampled)
            if error.mean() >= 0.9 * least:
                break
            best, least = levels, float(error.mean())
            levels = equidistributed_levels(self.points, error, levels, floor=floor)
        levels = snapped(resized_levels(best, options.size), options.shaper_size)
        return equidistributed_levels(self.points, self.fitted(function, levels)[1], levels, floor=floor)

    def fitted(self, function: Callable[[Array], Array], levels: Levels) -> tuple[Array, Array]:
        """The node values of least error at these levels, and the weighted squared errors of the points (m,).

        A node without points around it takes the function's own value. Black stays black.
        """
        sampled = function(grid(levels))
        nodes = fit_lattice(
            self.points, self.values, levels, method=self.interpolation, weight=self.weight / float(self.weight.mean()),
            prior=Prior(sampled, np.full_like(sampled, HOLD)), tolerance=1e-4,
        ).value  # fmt: skip
        nodes[0, 0, 0] = 0.0
        return nodes, self._error(levels, nodes)

    def _error(self, levels: Levels, nodes: Array) -> Array:
        return self.weight * squares(interpolate(self.points, levels, nodes, self.interpolation) - self.values)


def node_coverage(lattice: Lattice, samples: Array) -> Array:
    """The summed weight of samples (n, 3) at each node, (N_r, N_g, N_b)."""
    summed = normal_equations(samples, np.ones_like(samples), lattice.levels, lattice.interpolation)
    return np.ascontiguousarray(summed.right[..., 0])


def squares(difference: Array) -> Array:
    """The squared lengths (n,) of differences (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", difference, difference))
