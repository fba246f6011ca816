"""The plain form of a lattice that renders: the same function without a curve behind it, for files that hold none.

Codes rise steeply behind a clip on oblique planes, which a lattice along the axes cannot follow between its nodes; and
samples are sparser than its cells. But the lattice with a curve is known everywhere. So the plain one is fitted to the
samples and, around and between them, to that lattice, with node levels that share the error there out evenly.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from lutforge.calibration.lattice.lattice_problem import (
    SEARCH_SIZE,
    SEARCH_TOLERANCE,
    LatticeProblem,
    PlacedProblem,
    search_rows,
)
from lutforge.calibration.lattice.lattice_result import LatticeResult, result, snapped
from lutforge.calibration.options import CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice
from lutforge.solvers.bounded import solve_bounded
from lutforge.solvers.lattice_regression import LatticeFit, Prior
from lutforge.solvers.node_levels import equidistributed_levels, resized_levels
from lutforge.solvers.normal_equations import InterpolationMatrix, NormalEquations

Array = NDArray[np.float64]
Bounds = tuple[float, float]

POINTS_PER_NODE, MOST_POINTS = 4, 20_000
COUNTS, MOST_COUNTED = 0.2, 2.0
"""What a point of the lattice with a curve counts beside a sample: many samples speak for themselves. And how much all
of them count at most beside all samples."""
NEIGHBOURS = 4
SPREAD = 0.7
"""Standard deviation of the points around a sample, in distances to its NEIGHBOURS-th neighbour."""
POINTS_PER_CENTRE, MOST_NEIGHBOURS = 8, 5_000
LARGEST_SEARCH = 33
"""Nodes per axis up to which levels are searched at the size itself."""
ROUNDS, SMALL_ROUNDS = 2, 1
"""Of the search for node levels, on lattices of up to SEARCH_SIZE nodes the latter."""
SWEEPS = 6
KINKED = 2
"""The squared error of a cell of width h that a clip crosses grows like h^KINKED."""
POWER = 1.25
"""With which weights follow errors: an Lp norm of p = 2 + POWER, between the mean error and the largest."""
REWEIGHTED = 2
LEAST_FOLLOWED, MOST_FOLLOWED = 0.1, 20.0
"""Bounds of the errors that they follow, in units of their mean."""
COLOURS, FREE = (0.0, 1.0), (-0.25, 1.25)
"""Bounds of nodes that are colours, and of those with which a small lattice shows a clip between its nodes."""
BOUND_COST = 0.25 / 255.0
"""Nodes are colours where that costs no more than this of the mean error: a quarter of a code …"""
ALWAYS_COLOURS = 24
"""… and with so many nodes per axis or more."""


def fit_plain(x: Array, y: Array, curved: Lattice, options: CalibrationOptions, smoothness: float) -> LatticeResult:
    """The plain form of `curved`, a lattice with a curve that renders samples x → y (n, 3), with its λ_S."""
    near = _around(x, min(POINTS_PER_NODE * options.size**3, MOST_POINTS))
    rows = search_rows(len(x), options.size)
    search = problem = _problem(x, y, near, curved, options, smoothness)
    if len(rows) < len(x):
        search = _problem(x[rows], y[rows], near, curved, options, smoothness)
    levels = resized_levels(curved.levels, min(options.size, LARGEST_SEARCH))
    placed = BoundedProblem.at(search, levels, COLOURS)
    fit = placed.search_fit()
    if options.size < ALWAYS_COLOURS:
        free = BoundedProblem.at(search, levels, FREE)
        freely = free.search_fit()
        if float(placed.error(fit).mean()) - float(free.error(freely).mean()) > BOUND_COST:
            placed, fit = free, freely
    rounds = SMALL_ROUNDS if options.size <= SEARCH_SIZE else ROUNDS
    for rest in reversed(range(rounds if options.nonuniform else 0)):
        squares = search.weight * search.first_robust * placed.error(fit) ** 2
        levels = equidistributed_levels(search.x, squares, levels, KINKED)
        if rest:
            placed = BoundedProblem.at(search, levels, placed.bounds)
            fit = placed.search_fit(fit)
    levels = snapped(resized_levels(levels, options.size), options) if options.nonuniform else curved.levels
    placed = BoundedProblem.at(problem, levels, placed.bounds)
    return result(placed.lattice(placed.followed(fit)), x, y, smoothness)


@dataclass(frozen=True, eq=False)
class BoundedProblem(PlacedProblem):
    """The problem of samples and points of the lattice with a curve, with bounds of node values."""

    bounds: Bounds
    sweeps: int

    @classmethod
    def at(cls, problem: LatticeProblem, levels: Levels, bounds: Bounds, sweeps: int = SWEEPS) -> "BoundedProblem":
        matrix = InterpolationMatrix(problem.x, levels, problem.options.interpolation)
        return cls(problem, levels, matrix, bounds, sweeps)

    def solve(
        self, equations: NormalEquations, prior: Prior, smoothness: float, start: Array | None, tolerance: float
    ) -> LatticeFit:
        """smoothness: λ_S of a lattice of SEARCH_SIZE nodes. The sweeps are always as many."""
        smoothness = smoothness * len(self.levels[0]) / SEARCH_SIZE
        values = prior.values if start is None else start
        values = solve_bounded(equations, self.levels, smoothness, prior, values, self.bounds, self.sweeps)
        return LatticeFit(self.levels, values, iterations=self.sweeps)

    def search_fit(self, like: LatticeFit | None = None) -> LatticeFit:
        """A fit to search with; like: one at other levels, to start from."""
        return self.fit(self.problem.first_robust, SEARCH_TOLERANCE, like)

    def error(self, fit: LatticeFit) -> Array:
        """(n,), of the codes, which clip."""
        return np.asarray(np.linalg.norm(np.clip(self.matrix @ fit.values, 0.0, 1.0) - self.problem.y, axis=1))

    def followed(self, like: LatticeFit) -> LatticeFit:
        """The fit with weights that follow its errors (Lawson 1961); like: one at other levels, to start from."""
        robust = self.problem.first_robust
        weight, fit = robust, like
        for _ in range(REWEIGHTED):
            fit = self.fit(weight, SEARCH_TOLERANCE, fit)
            error = self.error(fit)
            follow = (LEAST_FOLLOWED + np.minimum(error / max(float(error.mean()), 1e-300), MOST_FOLLOWED)) ** POWER
            weight = robust * follow / follow.mean()
        return self.rising_fit(weight, fit.values, SEARCH_TOLERANCE)


def _problem(
    x: Array, y: Array, near: Array, curved: Lattice, options: CalibrationOptions, smoothness: float
) -> LatticeProblem:
    """Of the samples, and of points near them."""
    points, values = np.concatenate([x, near]), np.concatenate([y, curved(near)])
    weight = np.ones(len(points))
    weight[len(x) :] = min(COUNTS, MOST_COUNTED * len(x) / len(near))
    smoothness = smoothness * float(weight.sum()) / len(x)
    return LatticeProblem(points, values, values, weight, curved, options, True, smoothness, None)


def _around(x: Array, count: int) -> Array:
    """`count` points around samples x (n, 3) in [0, 1], the same ones every time, spread as samples are on the square
    root of linear light, which is near to even for noise and eye."""
    rng = np.random.default_rng(0)
    samples = np.sqrt(x[rng.permutation(len(x))[:MOST_NEIGHBOURS]])
    centres = samples[: count // POINTS_PER_CENTRE]
    distance = cKDTree(samples).query(centres, np.minimum([NEIGHBOURS + 1], len(samples)))[0]
    chosen = np.arange(count) % len(centres)
    spread: Array = centres[chosen] + SPREAD * distance[chosen] * rng.normal(size=(count, 3))
    return np.clip(spread, 0.0, 1.0) ** 2
