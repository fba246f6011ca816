"""Lattice regression at given node levels (thesis 5.4; Garcia & Gupta, NIPS 2009).

b̂ = argmin ‖Ω^½ (W b − y)‖² + λ_S ‖S (b − b₀)‖² + λ_T ‖T (b − b₀)‖² + λ_A ρ(b)
            + λ_K (b − b₀)'K (b − b₀) + ‖Λ (b − b₀)‖²

S is the second difference along each axis, T the mixed one across each pair of axes: together they smooth alike in all
directions, a thin plate in index space. b₀ is a prior mean that the result continues where no sample reaches, Λ² its
weight at each node; without one b₀ = 0, which leaves the thesis's own objective (λ_T = Λ = 0). Solved is for
b − b₀, from the samples' differences to the prior.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Single
from lutforge.errors import CalibrationError
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.solvers.conjugate_gradients import Operator, conjugate_gradients
from lutforge.solvers.multigrid import Multigrid
from lutforge.solvers.normal_equations import NormalEquations, normal_equations
from lutforge.solvers.penalties import ThinPlate, thin_plate
from lutforge.solvers.solution import Status
from lutforge.solvers.stencil import from_planar, planar


@dataclass(frozen=True)
class Regularization:
    """The weights of the terms beside the data. The defaults are the thesis's (5.3).

    smoothness: λ_S, of second differences; mixed: λ_T, of mixed second differences; anchor: λ_A, of the boundary term;
    thin_plate: λ_K.
    """

    smoothness: float = 0.1
    mixed: float = 0.0
    anchor: float = 0.01
    thin_plate: float = 1e-6


@dataclass(frozen=True, eq=False)
class Prior:
    """A prior mean b₀ of the node values, and its weight Λ² ≥ 0, both (N_r, N_g, N_b, 3)."""

    values: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class LatticeFit:
    """Node values (N_r, N_g, N_b, 3) at `levels`.

    status: how the solver ended; residual: relative to the right-hand side; iterations: how many it took.
    """

    levels: Levels
    values: Array
    status: Status = Status.CONVERGED
    residual: float = 0.0
    iterations: int = 0


def fit_lattice(
    x: Array,
    y: Array,
    levels: Levels,
    regularization: Regularization,
    *,
    method: Interpolation = "trilinear",
    weight: Array | None = None,
    prior: Prior | None = None,
    start: Array | None = None,
    tolerance: float = 1e-8,
) -> LatticeFit:
    """Fit node values to samples x (n, 3) in [0, 1] → y (n, 3), at the given node levels.

    weight: Ω, (n,); start: a first guess of the values, for a warm start. Time O(n) to assemble, O(N³) per iteration.
    """
    difference = y if prior is None else y - interpolate(x, levels, prior.values, method)
    equations = normal_equations(x, difference, levels, method, weight)
    return solve_lattice(equations, levels, regularization, prior=prior, start=start, tolerance=tolerance)


def solve_lattice(
    equations: NormalEquations,
    levels: Levels,
    regularization: Regularization,
    *,
    prior: Prior | None = None,
    start: Array | None = None,
    tolerance: float = 1e-8,
    most: int = 200,
) -> LatticeFit:
    """Fit node values to W'ΩW and W'Ω(y − W b₀), which serve several fits to the same samples.

    most: iterations at most. Raises CalibrationError where they leave a residual far from the tolerance.
    """
    right = equations.right
    anchor = np.zeros_like(right) if prior is None else prior.weight
    if regularization.anchor:
        held, target = _boundary(right.shape, regularization.anchor)
        right = right + held * (target if prior is None else target - prior.values)
        anchor = anchor + held
    offset = np.zeros_like(right) if prior is None else prior.values
    smoothness, mixed = regularization.smoothness, regularization.mixed
    multigrid = Multigrid(levels, equations.stencil, anchor, smoothness, mixed)
    operator: Operator = multigrid
    if (weight := regularization.thin_plate) > 0:
        # In index space ∂²b/∂u² is twice S b, and K counts ∂²b/∂u∂v twice. With both in the preconditioner the
        # equations are solved where nothing else smooths, too (λ_S = 0).
        like = Multigrid(levels, equations.stencil, anchor, smoothness + 4 * weight, mixed + 2 * weight)
        operator = _WithThinPlate(multigrid, like, thin_plate(multigrid.size), weight)
    first = None if start is None else planar(start - offset)
    solution = conjugate_gradients(operator, planar(right), first, tolerance=tolerance, most=most)
    if not solution.residual <= 1e3 * tolerance:  # what is nearer to the goal than that is of use
        raise CalibrationError(
            f"lattice regression: after {solution.iterations} iterations {solution.status.value}, with a residual of "
            f"{solution.residual:.1g}; the samples cover too little of colour space for this size: use a smaller --size"
        )
    values = offset + from_planar(solution.value, multigrid.size)
    return LatticeFit(levels, values, solution.status, solution.residual, solution.iterations)


@dataclass(frozen=True, eq=False)
class _WithThinPlate:
    """The operator of a multigrid cycle and λ_K K, preconditioned by the cycle of a like operator."""

    multigrid: Multigrid
    like: Multigrid
    plate: ThinPlate
    weight: float

    @property
    def threads(self) -> int:
        return self.multigrid.threads

    def product(self, b: Array, out: Array) -> None:
        self.multigrid.product(b, out)
        out += self.weight * planar(self.plate(from_planar(b, self.multigrid.size)))

    def precondition(self, residual: Array) -> Single:
        return self.like.precondition(residual)


def predict(fit: LatticeFit, x: Array, method: Interpolation = "trilinear") -> Array:
    """The fitted lattice at x (n, 3)."""
    return interpolate(x, fit.levels, fit.values, method)


def _boundary(shape: tuple[int, ...], weight: float) -> tuple[Array, Array]:
    """λ_A ρ(b) as a diagonal and the values that it draws to: black to black, a full channel to a full channel."""
    diagonal, target = np.zeros(shape), np.zeros(shape)
    diagonal[0, 0, 0, :] = weight
    for face in (np.s_[-1, :, :, 0], np.s_[:, -1, :, 1], np.s_[:, :, -1, 2]):
        diagonal[face] = weight
        target[face] = 1.0
    return diagonal, target
