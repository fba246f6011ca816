"""The lattice of chapter 5 as the fast form of a fitted camera model, at nodes where that bends.

The model is known everywhere, so that nothing is smoothed. What there is to choose is the nodes: they are placed where
interpolation between them errs most on likely scenes, in rounds that spread the squared error evenly (5.6 – 5.9 of the
thesis; de Boor 1973 for the exponent). Node values are then the least squares on these scenes, which halves the error
of sampled ones.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.node_levels import EVEN_DENSITY, equidistributed_levels, even_to_the_eye
from lutforge.calibration.lattice.output_curve import OutputCurve, output_curve
from lutforge.calibration.options import LatticeOptions
from lutforge.calibration.scenes import REST, RenderedScenes
from lutforge.interpolation import Interpolation, Levels, apply_curve, interpolate
from lutforge.model.gamut_map import from_even, to_even
from lutforge.model.inverse_gamut_map import SolvedInverse
from lutforge.model.lattice import Lattice, grid, nodes_at, resized_levels, snapped, uniform_levels, with_level_at
from lutforge.model.profile import CameraModel
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.normal_equations import normal_equations

SEARCH_SIZE = 13
"""Nodes per axis of the lattice on which levels are searched: the best ones hardly depend on their number."""
NODE_OFFSET = 0.005
"""ε of the perceptual scale that nodes are spaced by: dark codes need nodes of their own."""
SELDOM = 0.01
"""Share of likely scenes whose linear values are in the first cell of an axis of a rendering's lattice, or the last."""
OUTER_CELL = 0.01
"""Linear values of the first and of the last cell of a rendering's lattice, at least."""
LEAST_WITH_OUTER_CELLS = 13
"""Nodes per axis from which two are spent on linear values that hardly any scene has; fewer have 0 to 1."""
MODEL_WEIGHT = 1.0
"""The weight of the model's own value at a node, which keeps nodes with few colours around them where they belong."""


def bake_render(model: CameraModel, scenes: RenderedScenes, options: LatticeOptions) -> Lattice:
    """Bake the rendering of a camera model: white-balanced RAW → JPEG, by its matrix, a cube and an output curve.

    The cube holds the gamut map alone: a matrix is not multilinear on axes that are spaced by perception. Its axes are
    the linear values of likely scenes, and one cell more at either end, to what the matrix gives. Errors count after
    the curve.
    """
    curve = output_curve(model.response)
    values = curve.continued(scenes.mapped)
    # How much a squared error before the curve counts after it, 1 in the median.
    codes = np.linspace(0.0, 1.0, 511)[:, None].repeat(3, axis=1)
    counts = squares(apply_curve(curve.slope(codes), apply_curve(curve.table, values)))
    weight = scenes.weight * (counts / np.median(counts))

    if options.nonuniform:
        levels, black, white = _levels_of_rendering(model, scenes, curve, weight, options)
    else:
        levels, black, white = uniform_levels(options.size), np.zeros(3), np.ones(3)
    span = 1.0 / (white - black)
    least = -black * span  # the linear values where the axes begin

    task = _Task(np.clip((scenes.linear - least) / span, 0.0, 1.0), values, weight, options.interpolation, black)
    nodes, _ = task.fitted(lambda places: curve.continued(model.gamut_map(least + places * span)), levels)
    at_white = nodes_at(levels, white)  # not below what the model has there, where that is clipped
    nodes[at_white] = np.maximum(nodes[at_white], np.minimum(curve.continued(model.gamut_map(np.ones(3))), 1.0))
    to_axes = np.column_stack([model.matrix / span[:, None], black])
    return Lattice(levels, nodes, options.interpolation, curve.table, to_axes)


def _levels_of_rendering(
    model: CameraModel, scenes: RenderedScenes, curve: OutputCurve, weight: Array, options: LatticeOptions
) -> tuple[Levels, Array, Array]:
    """Node levels of a rendering, and the places (3,) of black and white among them.

    All but the first and the last lie where likely scenes are; these two are at the least and the largest linear value
    that the matrix gives.
    """
    has_outer_cells = options.size >= LEAST_WITH_OUTER_CELLS
    count = options.size - 2 if has_outer_cells else options.size
    low, high = np.zeros(3), np.ones(3)
    if has_outer_cells:
        seen = scenes.linear[scenes.weight > REST]
        low = np.minimum(np.quantile(seen, SELDOM, axis=0), 0.0)
        high = np.maximum(np.quantile(seen, 1.0 - SELDOM, axis=0), 1.0)
    places = np.clip((scenes.linear - low) / (high - low), 0.0, 1.0)
    task = _Task(places, curve.continued(scenes.mapped), weight, options.interpolation)

    # A tenth of the nodes is at perceptually uniform steps: bright samples alone would make the first cell so wide that
    # it holds all dark codes of usual pictures.
    floor = EVEN_DENSITY + even_to_the_eye(0.1, NODE_OFFSET)
    even = np.linspace(to_even(low, NODE_OFFSET), to_even(high, NODE_OFFSET), min(SEARCH_SIZE, count))
    red, green, blue = ((from_even(even, NODE_OFFSET) - low) / (high - low)).T
    inner = task.best_levels(
        lambda x: curve.continued(model.gamut_map(low + x * (high - low))),
        (red, green, blue),
        floor,
        count,
        options.shaper_size,
    )
    if not has_outer_cells:
        return snapped(inner, options.shaper_size), low, high

    # The axes reach so far that black and white are on the grid of the shaper.
    steps = options.shaper_size - 1
    below = OUTER_CELL - np.minimum(model.matrix, 0.0).sum(axis=1)
    above = OUTER_CELL + np.maximum(high, np.maximum(model.matrix, 0.0).sum(axis=1))
    black = np.ceil(steps * below / (below + above)) / steps
    white = np.floor(steps * (below + 1.0) / (below + above)) / steps
    inside = black + (white - black) * (low + np.stack(inner, axis=1) * (high - low))
    red, green, blue = np.vstack([np.zeros(3), inside, np.ones(3)]).T
    levels = with_level_at(snapped((red, green, blue), options.shaper_size), black)
    return with_level_at(levels, white), black, white


def bake_linearize(model: CameraModel, scenes: RenderedScenes, options: LatticeOptions) -> Lattice:
    """Bake the inverse of a camera model: JPEG → white-balanced RAW.

    A camera maps wide ranges of RAW to few codes. So the lattice is the least squares on likely scenes, which comes
    near to their mean given the code. Where there are none, it follows the inverse that is solved.
    """
    unclipped = scenes.whole
    task = _Task(scenes.codes[unclipped], scenes.balanced[unclipped], scenes.weight[unclipped], options.interpolation)
    to_balanced = np.linalg.inv(model.matrix).T
    inverse = model.inverse_gamut_map
    start = inverse.start if isinstance(inverse, SolvedInverse) else inverse

    def likely_balanced(codes: Array) -> Array:
        return start(model.response.linearize(codes)) @ to_balanced

    levels = uniform_levels(options.size)
    if options.nonuniform:
        even = np.linspace(0.0, 1.0, min(SEARCH_SIZE, options.size))
        levels = task.best_levels(likely_balanced, (even, even, even), EVEN_DENSITY, options.size, options.shaper_size)
    levels = snapped(levels, options.shaper_size)

    nodes, _ = task.fitted(model.linearize, levels)
    return Lattice(levels, nodes, options.interpolation)


@dataclass(frozen=True, eq=False)
class _Task:
    """What a lattice is fitted to.

    points: (m, 3), in [0, 1]; values: (m, 3); weight: (m,); black: (3,), the place of black on the axes.
    """

    points: Array
    values: Array
    weight: Array
    interpolation: Interpolation
    black: Array = field(default_factory=lambda: np.zeros(3))

    def best_levels(
        self, function: Callable[[Array], Array], start: Levels, floor: Array, size: int, shaper_size: int
    ) -> Levels:
        """Node levels in rounds, each from the errors between the nodes of the one before; the last of a whole lattice.

        start: those of the first round; floor: (BINS,), the density of nodes that stay whatever the errors; size: nodes
        per axis; shaper_size: entries of the shaper that will hold them.
        """
        levels = start
        best, least = levels, np.inf
        for _ in range(6):
            # The lattice of these rounds is small, and its nodes are sampled: the best levels hardly depend on either.
            sampled = function(grid(levels))
            error = self._error(levels, sampled)
            if error.mean() >= 0.9 * least:
                break
            best, least = levels, float(error.mean())
            levels = equidistributed_levels(self.points, error, levels, floor=floor)
        levels = snapped(resized_levels(best, size), shaper_size)
        return equidistributed_levels(self.points, self.fitted(function, levels)[1], levels, floor=floor)

    def fitted(self, function: Callable[[Array], Array], levels: Levels) -> tuple[Array, Array]:
        """The node values of least error at these levels, and the weighted squared errors of the points (m,).

        A node without points around it takes the function's own value. Black stays black where it is a node.
        """
        sampled = function(grid(levels))
        nodes = fit_lattice(
            self.points, self.values, levels, method=self.interpolation, weight=self.weight / float(self.weight.mean()),
            prior=Prior(sampled, np.full_like(sampled, MODEL_WEIGHT)), tolerance=1e-4,
        ).value  # fmt: skip
        nodes[nodes_at(levels, self.black)] = 0.0
        return nodes, self._error(levels, nodes)

    def _error(self, levels: Levels, nodes: Array) -> Array:
        return self.weight * squares(interpolate(self.points, levels, nodes, self.interpolation) - self.values)


def node_coverage(lattice: Lattice, samples: Array) -> Array:
    """The summed weight of samples (n, 3) at each node, (N_r, N_g, N_b)."""
    summed = normal_equations(lattice.on_axes(samples), np.ones_like(samples), lattice.levels, lattice.interpolation)
    return np.ascontiguousarray(summed.right[..., 0])


def squares(difference: Array) -> Array:
    """The squared lengths (n,) of differences (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", difference, difference))
