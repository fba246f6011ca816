"""One direction of one style as a problem to solve: samples, prior, grey axis and bounds, at any node levels."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import isotonic_regression

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.continuation import OFFSET, Continuation
from lutforge.calibration.lattice.node_levels import EVEN, equidistributed_levels, even_to_the_eye
from lutforge.calibration.lattice.output_curve import OutputCurve
from lutforge.calibration.lattice.rising_axis import with_rising_axis
from lutforge.calibration.options import SEARCH_SIZE, CalibrationOptions, LatticeFitOptions
from lutforge.interpolation import Levels, apply_curve, interpolate
from lutforge.model.gamut_map import from_even
from lutforge.model.lattice import Lattice, grid
from lutforge.solvers.lattice_regression import LatticeFit, Prior, Regularization, solve_lattice
from lutforge.solvers.normal_equations import InterpolationMatrix, NormalEquations
from lutforge.solvers.robust_weights import RobustWeights, cauchy


def outlier_weights(squared_error: Array, options: LatticeFitOptions) -> Array:
    """Return IRLS weights in [0, 1] of samples with these squared errors (n,)."""
    return RobustWeights(cauchy, options.outlier_scale, options.least_outlier)(np.sqrt(squared_error))


def curve_weights(curve: OutputCurve, y: Array) -> Array:
    """Return how much an error of the cube counts behind the curve at y (n, 3), (n,); 1 in the median."""
    codes = np.linspace(0.0, 1.0, 511)[:, None].repeat(3, axis=1)  # two codes of 255 a step
    slope = apply_curve(curve.slope(codes), y)  # tabulated: y may hold millions
    square = squares(slope)
    return np.asarray(square / np.median(square))


def squares(difference: Array) -> Array:
    """Return the squared lengths (n,) of differences (n, 3)."""
    return np.asarray(np.einsum("nc,nc->n", difference, difference))


def search_rows(count: int, size: int) -> NDArray[np.intp]:
    """Return the samples to search with, the same ones every time, for a lattice of `size` nodes per axis.

    They are at most two a node, and 50,000.
    """
    most = min(50_000, 2 * size**3)
    if count <= most:
        return np.arange(count)
    return np.random.default_rng(0).choice(count, most, replace=False, shuffle=False)


PriorMean = Callable[[Array], Array]
"""What a lattice should be where there are no samples: node positions (…, 3) → values (…, 3)."""

GREY = np.linspace(0.0, 1.0, 257)[:, None].repeat(3, axis=1)


@dataclass(frozen=True, eq=False)
class LatticeProblem:
    """The data of a lattice fit to n samples, which stay the same while node levels and weights are searched.

    x, y: (n, 3); target: the values of the cube at the samples, in front of the output curve, (n, 3); weight: of their
    errors, so that these count as behind the curve, (n,); prior_mean: of the lattice; clips: the camera clips in this
    direction, as in a render; smoothness: λ_S, stated for SEARCH_SIZE nodes; curve: the output curve, or none.
    """

    x: Array
    y: Array
    target: Array
    weight: Array
    prior_mean: PriorMean
    options: CalibrationOptions
    clips: bool
    smoothness: float
    curve: OutputCurve | None

    def leave_out(self, held: list[Mask]) -> "list[LatticeProblem]":
        """Return, for each mask, the problem of all other samples, with a prior mean that has not seen those."""
        if isinstance(self.prior_mean, Continuation):
            means: list[PriorMean] = [*self.prior_mean.leave_out(self.x, self.y, held)]
        else:
            means = [self.prior_mean] * len(held)
        return [self.select(~mask, mean) for mask, mean in zip(held, means, strict=True)]

    def select(self, rows: NDArray[np.intp] | Mask, prior_mean: PriorMean) -> "LatticeProblem":
        """The problem of some of the samples, with another prior mean."""
        return replace(
            self,
            x=self.x[rows],
            y=self.y[rows],
            target=self.target[rows],
            weight=self.weight[rows],
            prior_mean=prior_mean,
        )

    def with_points(self, points: Array, values: Array) -> "LatticeProblem":
        """The problem of the samples and of points (m, 3) with the values (m, 3) that the lattice should have there.

        All points together have at most twice the weight of the samples. λ_S grows with the sum of the weights. Raises
        ValueError behind an output curve, whose weights the points lack.
        """
        if self.curve is not None:
            raise ValueError("points are encoded values, and the problem has an output curve behind them")
        count = len(self.x)
        weight = np.full(len(points), min(self.options.lattice.point_weight, 2.0 * count / max(len(points), 1)))
        together = np.concatenate([self.weight, weight])
        return replace(
            self,
            x=np.concatenate([self.x, points]),
            y=np.concatenate([self.y, values]),
            target=np.concatenate([self.target, values]),
            weight=together,
            smoothness=self.smoothness * float(together.sum()) / count,
        )

    @cached_property
    def first_robust(self) -> Array:
        """Robust weights (n,) before any lattice is fitted, from the prior mean, which no single outlier changes."""
        return outlier_weights(squares(np.clip(self.prior_at_samples, 0.0, 1.0) - self.y), self.options.lattice)

    @cached_property
    def prior_at_samples(self) -> Array:
        """(n, 3): the prior mean at the samples."""
        return self.prior_mean(self.x)

    @cached_property
    def grey(self) -> Array:
        """The values (257, 3) of the cube on GREY: neutral, with the mean brightness of the prior mean."""
        values = np.clip(self.prior_mean(GREY), 0.0, 1.0).mean(axis=1, keepdims=True).repeat(3, axis=1)
        return values if self.curve is None else self.curve.to_values(values)

    @property
    def grey_weight(self) -> Array:
        """The weight (257,) of each point of GREY, where a sample has 1."""
        return np.full(len(GREY), self.options.lattice.grey_weight)

    def at(self, levels: Levels) -> "PlacedProblem":
        """The problem at given node levels."""
        return PlacedProblem(self, levels, InterpolationMatrix(self.x, levels, self.options.interpolation))

    def levels(self, size: int) -> Levels:
        """Choose node levels in rounds that distribute the interpolation error of the prior mean evenly; keep the best.

        The prior mean has no noise, and its curvature is known without fitting a lattice. The first levels are evenly
        spaced, on the even scale where there is an output curve.
        """
        even = np.linspace(0.0, 1.0, size)
        start = even if self.curve is None else from_even(even, OFFSET)
        levels, best = (start, start, start), (np.inf, (start, start, start))
        for _ in range(6):
            error = self.at(levels).lost()
            mean = float(np.mean(error))
            stalled = mean > 0.9 * best[0]
            best = min(best, (mean, levels), key=lambda entry: entry[0])
            if stalled:
                break
            levels = self.moved_levels(levels, error)
        return best[1]

    def moved_levels(self, levels: Levels, error: Array) -> Levels:
        """Better node levels, from the squared errors (n,) of a lattice at `levels`."""
        floor = EVEN if self.curve is None else EVEN + even_to_the_eye(self.options.lattice.eye_share, OFFSET)
        return equidistributed_levels(self.x, error, levels, floor=floor)


@dataclass(frozen=True, eq=False)
class PlacedProblem:
    """A problem at given node levels, for several fits there; matrix: W of its samples."""

    problem: LatticeProblem
    levels: Levels
    matrix: InterpolationMatrix

    @cached_property
    def prior(self) -> Prior:
        """The prior mean at the nodes, and its weight there."""
        problem, positions = self.problem, grid(self.levels)
        if problem.curve is None:
            values = np.clip(problem.prior_mean(positions), 0.0, 1.0)
        elif isinstance(problem.prior_mean, Continuation):
            values = np.clip(problem.prior_mean.values(positions), -1.0, 2.0)  # the curve clamps to [0, 1]
        else:
            values = problem.curve.to_values(np.clip(problem.prior_mean(positions), 0.0, 1.0))
        weight, firm = np.full_like(values, problem.options.lattice.prior_weight), 1e3
        values[0, 0, 0], weight[0, 0, 0] = 0.0, firm  # no sample can lie there, nor where the camera clips all channels
        if problem.clips:
            # Behind a curve white may lie beyond 1: the cube need not turn back to it.
            values[-1, -1, -1] = 1.0 if problem.curve is None else np.maximum(values[-1, -1, -1], 1.0)
            weight[-1, -1, -1] = firm
        return Prior(values, weight)

    @cached_property
    def _grey(self) -> InterpolationMatrix:
        return InterpolationMatrix(GREY, self.levels, self.problem.options.interpolation)

    def equations(self, weight: Array) -> NormalEquations:
        """Return W'ΩW and W'Ω(y − W b₀) of the samples. weight: (n,), times the weights of the output curve."""
        difference = self.problem.target - self.matrix @ self.prior.values
        return self.matrix.normal_equations(difference, self.problem.weight * weight)

    def with_grey(
        self, equations: NormalEquations, values: Array | None = None, weight: Array | None = None
    ) -> NormalEquations:
        """Add values on the grey axis, (257, 3), with weights (257,): by default the prior mean's, and the option's."""
        values = self.problem.grey if values is None else values
        weight = self.problem.grey_weight if weight is None else weight
        return equations + self._grey.normal_equations(values - self._grey @ self.prior.values, weight)

    def solve(
        self, equations: NormalEquations, prior: Prior, smoothness: float, start: Array | None, tolerance: float
    ) -> LatticeFit:
        """Solve the equations at these levels. smoothness: λ_S, stated for SEARCH_SIZE nodes."""
        smoothness = smoothness * len(self.levels[0]) / SEARCH_SIZE
        regularization = Regularization(smoothness, mixed=smoothness, anchor=0.0, thin_plate=0.0)
        return solve_lattice(equations, self.levels, regularization, prior=prior, start=start, tolerance=tolerance)

    def moved(self, fit: LatticeFit) -> LatticeFit:
        """Interpolate a fit at other levels to these levels."""
        if all(map(np.array_equal, fit.levels, self.levels)):
            return fit
        return LatticeFit(self.levels, interpolate(grid(self.levels), fit.levels, fit.values))

    def fit(self, weight: Array, tolerance: float, like: LatticeFit | None = None) -> LatticeFit:
        """Fit to the samples and the grey axis. weight: (n,); like: a fit at other levels, to start from."""
        start = None if like is None else self.moved(like).values
        equations = self.with_grey(self.equations(weight))
        return self.solve(equations, self.prior, self.problem.smoothness, start, tolerance)

    def rising_fit(self, weight: Array, start: Array, tolerance: float) -> LatticeFit:
        """Fit; while the grey axis falls, fit again with its isotonic regression as data there, at most four times."""
        problem, least_fall = self.problem, 1e-6
        values, grey_weight = problem.grey.copy(), problem.grey_weight
        samples = self.equations(weight)
        for _ in range(4):
            equations = self.with_grey(samples, values, grey_weight)
            fit = self.solve(equations, self.prior, problem.smoothness, start, tolerance)
            axis = np.clip(self._grey @ fit.values, 0.0, 1.0)
            if np.diff(axis, axis=0).min() >= -least_fall:
                break
            rising = np.stack([isotonic_regression(channel).x for channel in axis.T], axis=1)
            falls = np.any(np.abs(rising - axis) > 0.1 * least_fall, axis=1)
            values[falls], grey_weight[falls] = rising[falls], 30.0
            start = fit.values
        return fit

    def lattice(self, fit: LatticeFit) -> Lattice:
        """A fit at these levels, as profiles keep it."""
        problem, values = self.problem, fit.values.copy()
        curve, method = problem.curve, problem.options.interpolation
        values[0, 0, 0] = 0.0  # the weight that holds this node leaves a small rest
        if problem.clips:
            values[-1, -1, -1] = 1.0 if curve is None else np.maximum(values[-1, -1, -1], 1.0)
        if curve is not None:
            return Lattice(fit.levels, with_rising_axis(values, fit.levels, method), method, curve.table)
        # A node that no sample touches may not leave the range of colours; the others carry on across the clipping,
        # which the camera does after the smooth function that they describe.
        values = np.where(self.matrix.touched[..., None], values, np.clip(values, 0.0, 1.0))
        return Lattice(fit.levels, with_rising_axis(values, fit.levels, method), method)

    def squared_error(self, fit: LatticeFit) -> Array:
        """Return the squared errors (n,) of a fit at these levels, behind the output curve."""
        return squares(self._output(fit.values) - self.problem.y)

    def lost(self) -> Array:
        """Return the squared errors (n,) of the prior mean interpolated between nodes, times the robust weights."""
        return self.problem.first_robust * squares(self._output(self.prior.values) - self.problem.prior_at_samples)

    def _output(self, values: Array) -> Array:
        """(n, 3): what node values make of the samples, behind the curve."""
        between, curve = self.matrix @ values, self.problem.curve
        return between if curve is None else curve.to_encoded(between)
