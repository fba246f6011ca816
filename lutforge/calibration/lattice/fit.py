"""The lattice of chapter 5 as the fast form of a fitted camera model, at nodes where that bends.

The model is known everywhere, so that nothing is smoothed. What there is to choose is the nodes: they are placed where
interpolation between them errs most on likely colours, in rounds that spread the squared error evenly (5.6 – 5.9 of the
thesis; de Boor 1973 for the exponent). Node values are then the least squares on these colours, which halves the
error of sampled ones.
"""

from collections.abc import Callable

import numpy as np
from scipy.ndimage import binary_dilation, maximum_filter
from scipy.spatial import cKDTree

from lutforge.arrays import Array, Index, Mask
from lutforge.calibration.gamut_map import OFFSET, neutral_scenes
from lutforge.calibration.lattice.node_levels import EVEN, equidistributed_levels, even_to_the_eye
from lutforge.calibration.lattice.output_curve import OutputCurve
from lutforge.calibration.options import LatticeOptions
from lutforge.interpolation import Levels, apply_curve, interpolate
from lutforge.model.gamut_map import from_even
from lutforge.model.lattice import Lattice, grid, resized_levels, snapped, uniform_levels
from lutforge.sobol import sobol
from lutforge.solvers.lattice_regression import Prior, fit_lattice
from lutforge.solvers.normal_equations import normal_equations

SEARCH_SIZE = 13
"""Nodes per axis of the lattice on which levels are searched: the best ones hardly depend on their number."""
HOLD = 1.0
"""The weight of the model's own value at a node, which keeps nodes with few colours around them where they belong."""
REST = 0.02
"""The weight of a colour anywhere in the cube, where one near a sample has 1."""


def bake_lattice(
    model: Callable[[Array], Array],
    points: Array,
    values: Array,
    weight: Array,
    options: LatticeOptions,
    curve: OutputCurve | None = None,
    levels: Levels | None = None,
    asked: Array | None = None,
) -> Lattice:
    """Bake a model (n, 3) → (n, 3), which nodes follow, to likely colours in [0, 1] and their values, both (m, 3).

    weight: (m,), of these colours. curve: what comes behind the cube; then model and values are in front of it, and
    errors count behind it. levels: of the nodes; without them the best are searched. asked: (k, 3), colours that alone
    the lattice will be asked for, at given levels; nodes that lie apart from them are 0.
    """
    cells = None
    if asked is not None and levels is not None:
        around = np.zeros([len(axis) - 1 for axis in levels], dtype=np.bool_)
        around[_cells_of(asked, levels)] = True
        cells = binary_dilation(around)  # and those that share a face with one
        near = cells[_cells_of(points, levels)]
        points, values, weight = points[near], values[near], weight[near]
    if curve is not None:
        # How much a squared error in front of the curve counts behind it, 1 in the median.
        codes = np.linspace(0.0, 1.0, 511)[:, None].repeat(3, axis=1)
        square = squares(apply_curve(curve.slope(codes), apply_curve(curve.table, values)))
        weight = weight * (square / np.median(square))
    if levels is None and options.nonuniform:
        levels = _levels(model, points, values, weight, options, curve)
        lattice, error = _fitted(model, points, values, weight, levels, options, curve)
        levels = equidistributed_levels(points, error, lattice.levels, floor=_floor(curve))
    levels = levels or uniform_levels(options.size)
    return _fitted(model, points, values, weight, levels, options, curve, cells)[0]


def node_coverage(lattice: Lattice, samples: Array) -> Array:
    """The summed weight of samples (n, 3) at each node, (N_r, N_g, N_b)."""
    summed = normal_equations(samples, np.ones_like(samples), lattice.levels, lattice.interpolation)
    return np.ascontiguousarray(summed.right[..., 0])


def likely_light(samples: Array, size: int) -> tuple[Array, Array]:
    """Light to bake on, (m, 3), the same every time, and its weights (m,): the samples, near them, greys, anywhere.

    samples: (n, 3); size: nodes per axis. Light near a sample is normally distributed around it with the distance to
    its fourth neighbour, on the square root of linear light, which is near to even for noise and eye.
    """
    rng, count = np.random.default_rng(0), min(4 * size**3, 20_000)
    chosen = samples[rng.permutation(len(samples))[: count // 2]]
    root = np.sqrt(np.clip(chosen, 0.0, 1.0))
    distance = cKDTree(root).query(root, k=[min(5, len(root))])[0]
    places = rng.integers(0, len(root), count)
    near = (root[places] + 0.7 * distance[places] * rng.standard_normal((count, 3))) ** 2
    near = near[np.all(near < 1.0, axis=1)]
    likely = np.concatenate([chosen, near, neutral_scenes(count // 20)])
    anywhere = np.concatenate([sobol(count // 4), from_even(sobol(count // 4, seed=1), OFFSET)])
    weight = np.concatenate([np.ones(len(likely)), np.full(len(anywhere), REST)])
    return np.concatenate([likely, anywhere]), weight


def _levels(
    model: Callable[[Array], Array],
    points: Array,
    values: Array,
    weight: Array,
    options: LatticeOptions,
    curve: OutputCurve | None,
) -> Levels:
    """Node levels in rounds, each from the errors between the nodes of the one before; those of least error are kept.

    The lattice of these rounds is small, and its nodes are sampled: the best levels hardly depend on either.
    """
    even = np.linspace(0.0, 1.0, min(SEARCH_SIZE, options.size))
    start = even if curve is None else from_even(even, OFFSET)
    levels: Levels = (start, start, start)
    best, least = levels, np.inf
    for _ in range(6):
        sampled = model(grid(levels).reshape(-1, 3)).reshape(len(even), len(even), len(even), 3)
        error = weight * squares(interpolate(points, levels, sampled, options.interpolation) - values)
        if error.mean() >= 0.9 * least:
            break
        best, least = levels, float(error.mean())
        levels = equidistributed_levels(points, error, levels, floor=_floor(curve))
    return resized_levels(best, options.size)


def _fitted(
    model: Callable[[Array], Array],
    points: Array,
    values: Array,
    weight: Array,
    levels: Levels,
    options: LatticeOptions,
    curve: OutputCurve | None,
    cells: Mask | None = None,
) -> tuple[Lattice, Array]:
    """The lattice of least error on the points, at these levels on the shaper's grid, and its weighted errors (m,).

    Black stays black. cells: (N_r − 1, N_g − 1, N_b − 1), those whose nodes are computed.
    """
    levels = snapped(levels, options.shaper_size)
    nodes_at = grid(levels)
    if cells is None:
        sampled = model(nodes_at)
    else:
        corners = maximum_filter(np.pad(cells, (0, 1)), 2)
        sampled = np.zeros_like(nodes_at)
        sampled[corners] = model(nodes_at[corners])
    # A node without colours around it takes the model's own value.
    nodes = fit_lattice(
        points, values, levels, method=options.interpolation, weight=weight / float(weight.mean()),
        prior=Prior(sampled, np.full_like(sampled, HOLD)), tolerance=1e-4,
    ).value  # fmt: skip
    nodes[0, 0, 0] = 0.0
    error = weight * squares(interpolate(points, levels, nodes, options.interpolation) - values)
    return Lattice(levels, nodes, options.interpolation, None if curve is None else curve.table), error


def _cells_of(colours: Array, levels: Levels) -> tuple[Index, ...]:
    """Which cell holds each colour (n, 3): its number along each axis."""
    inner = (axis[1:-1] for axis in levels)
    return tuple(np.searchsorted(axis, column, side="right") for axis, column in zip(inner, colours.T, strict=True))


def _floor(curve: OutputCurve | None) -> Array:
    """The density of nodes that stay whatever the errors.

    In a render a tenth of them is at perceptually even steps: bright samples alone would make the first cell so wide
    that it holds all dark codes of usual pictures.
    """
    return EVEN if curve is None else EVEN + even_to_the_eye(0.1, OFFSET)


def squares(difference: Array) -> Array:
    """The squared lengths (n,) of differences (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", difference, difference))
