"""The plain form of a lattice that renders: the same function without a curve behind it, for files that hold none.

A lattice along the axes cannot follow the kink where a camera clips, which lies on oblique planes, and there are fewer
samples than cells. But the lattice with a curve is known everywhere. So the plain form is fitted to the samples and to
points of that lattice around and between them, with node levels that distribute the error evenly.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from lutforge.arrays import Array
from lutforge.calibration.lattice.node_levels import equidistributed_levels
from lutforge.calibration.lattice.problem import LatticeProblem, PlacedProblem, search_rows
from lutforge.calibration.lattice.result import LatticeResult, result, snapped
from lutforge.calibration.options import SEARCH_SIZE, CalibrationOptions
from lutforge.interpolation import Levels
from lutforge.model.lattice import Lattice, resized_levels
from lutforge.solvers.lattice_regression import LatticeFit, Prior
from lutforge.solvers.normal_equations import InterpolationMatrix, NormalEquations
from lutforge.solvers.projected_gauss_seidel import solve_bounded
from lutforge.solvers.robust_weights import lawson

Bounds = tuple[float, float]


def fit_plain(x: Array, y: Array, curved: Lattice, options: CalibrationOptions, smoothness: float) -> LatticeResult:
    """The plain form of `curved`, a lattice with a curve that renders samples x → y (n, 3), with its λ_S."""
    near = _around(x, min(4 * options.size**3, 20_000))
    rows = search_rows(len(x), options.size)
    search = problem = _problem(x, y, near, curved, options, smoothness)
    if len(rows) < len(x):
        search = _problem(x[rows], y[rows], near, curved, options, smoothness)
    levels = resized_levels(curved.levels, min(options.size, 33))
    placed = BoundedProblem.at(search, levels, (0.0, 1.0))
    fit = placed.search_fit()
    if options.size < 24:  # between the nodes of larger ones there is little room
        free = BoundedProblem.at(search, levels, (-0.25, 1.25))  # so that a clip shows between the nodes
        freely = free.search_fit()
        if float(placed.error(fit).mean()) - float(free.error(freely).mean()) > options.lattice.bound_cost:
            placed, fit = free, freely
    rounds = 1 if options.size <= SEARCH_SIZE else 2
    for rest in reversed(range(rounds if options.nonuniform else 0)):
        squares = search.weight * search.first_robust * placed.error(fit) ** 2
        levels = equidistributed_levels(search.x, squares, levels, order=2)  # the order in cells that a clip crosses
        if rest:
            placed = BoundedProblem.at(search, levels, placed.bounds)
            fit = placed.search_fit(fit)
    levels = snapped(resized_levels(levels, options.size), options) if options.nonuniform else curved.levels
    placed = BoundedProblem.at(problem, levels, placed.bounds)
    return result(placed.lattice(placed.followed(fit)), x, smoothness)


@dataclass(frozen=True, eq=False)
class BoundedProblem(PlacedProblem):
    """The problem of samples and points of the lattice with a curve, with bounds of node values."""

    bounds: Bounds

    @classmethod
    def at(cls, problem: LatticeProblem, levels: Levels, bounds: Bounds) -> "BoundedProblem":
        """Return the problem at given node levels and bounds."""
        matrix = InterpolationMatrix(problem.x, levels, problem.options.interpolation)
        return cls(problem, levels, matrix, bounds)

    def solve(
        self, equations: NormalEquations, prior: Prior, smoothness: float, start: Array | None, tolerance: float
    ) -> LatticeFit:
        """Solve with bounded node values by a fixed number of sweeps. smoothness: λ_S, stated for SEARCH_SIZE nodes."""
        smoothness = smoothness * len(self.levels[0]) / SEARCH_SIZE
        values = prior.values if start is None else start
        # The last sweep still moves a node by up to a code. Sweeping until none moves by a quarter changes the mean by
        # 1 % at most on the D40's pairs, to either side, so that the limit is accepted.
        return solve_bounded(equations, self.levels, smoothness, prior, values, self.bounds, sweeps=6)

    def search_fit(self, like: LatticeFit | None = None) -> LatticeFit:
        """Fit to the tolerance of a search for levels and weights. like: a fit at other levels, to start from."""
        return self.fit(self.problem.first_robust, self.problem.options.lattice.search_tolerance, like)

    def error(self, fit: LatticeFit) -> Array:
        """Return the errors (n,) of a fit whose outputs are clipped to [0, 1]."""
        return np.asarray(np.linalg.norm(np.clip(self.matrix @ fit.values, 0.0, 1.0) - self.problem.y, axis=1))

    def followed(self, like: LatticeFit) -> LatticeFit:
        """Fit with weights that grow with the errors of the last fit (Lawson 1961). like: as for `search_fit`."""
        robust, options = self.problem.first_robust, self.problem.options.lattice
        weight, fit = robust, like
        for _ in range(2):
            fit = self.fit(weight, options.search_tolerance, fit)
            follow = lawson(self.error(fit), options.follow_power)
            weight = robust * follow / follow.mean()
        return self.rising_fit(weight, fit.values, options.search_tolerance)


def _problem(
    x: Array, y: Array, near: Array, curved: Lattice, options: CalibrationOptions, smoothness: float
) -> LatticeProblem:
    """State the problem of the samples and of points near them."""
    samples = LatticeProblem(x, y, y, np.ones(len(x)), curved, options, True, smoothness, None)
    return samples.with_points(near, curved(near))


def _around(x: Array, count: int) -> Array:
    """Return `count` points around samples x (n, 3) in [0, 1], the same ones every time.

    They are spread as samples are on the square root of linear light, which is near to even for noise and eye: normally
    distributed around each, with a deviation of 0.7 distances to its fourth neighbour.
    """
    rng, per_centre, neighbour, spread = np.random.default_rng(0), 8, 4, 0.7
    samples = np.sqrt(x[rng.permutation(len(x))[:5_000]])
    centres = samples[: count // per_centre]
    distance = cKDTree(samples).query(centres, np.minimum([neighbour + 1], len(samples)))[0]
    chosen = np.arange(count) % len(centres)
    points: Array = centres[chosen] + spread * distance[chosen] * rng.normal(size=(count, 3))
    return np.clip(points, 0.0, 1.0) ** 2
