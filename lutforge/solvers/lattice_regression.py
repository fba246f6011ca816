"""Lattice regression at given node levels (thesis 5.4; Garcia & Gupta, NIPS 2009).

b̂ = argmin ‖Ω^½ (W b − y)‖² + λ_S ‖S (b − b₀)‖² + λ_T ‖T (b − b₀)‖² + λ_A ρ(b)
            + λ_K (b − b₀)'K (b − b₀) + ‖Λ (b − b₀)‖²

S is the second difference along each axis, T the mixed one across each pair of axes: together they smooth alike in all
directions, a thin plate in index space. b₀ is a prior lattice that the result continues where no sample reaches, Λ² how
firmly a node is held to it; without one b₀ = 0, which leaves the thesis's own objective (λ_T = Λ = 0). Solved is for
b − b₀, from the samples' differences to the prior.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.solvers.conjugate_gradients import solve
from lutforge.solvers.multigrid import Multigrid
from lutforge.solvers.normal_equations import NormalEquations, normal_equations
from lutforge.solvers.smoothness import thin_plate

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Regularisation:
    """The weights of the terms beside the data: λ_S, λ_T, λ_A, λ_K. The defaults are the thesis's (5.3)."""

    smoothness: float = 0.1
    twist: float = 0.0
    anchor: float = 0.01
    thin_plate: float = 1e-6


@dataclass(frozen=True, eq=False)
class Prior:
    """b₀ and Λ²: values (N_r, N_g, N_b, 3), hold (N_r, N_g, N_b, 3) ≥ 0."""

    values: Array
    hold: Array


@dataclass(frozen=True, eq=False)
class LatticeFit:
    """Node values (N_r, N_g, N_b, 3) at `levels`, and the iterations that the solver took."""

    levels: Levels
    values: Array
    iterations: int


def fit_lattice(
    x: Array,
    y: Array,
    levels: Levels,
    regularisation: Regularisation,
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
    return solve_lattice(equations, levels, regularisation, prior=prior, start=start, tolerance=tolerance)


def solve_lattice(
    equations: NormalEquations,
    levels: Levels,
    regularisation: Regularisation,
    *,
    prior: Prior | None = None,
    start: Array | None = None,
    tolerance: float = 1e-8,
) -> LatticeFit:
    """The same from W'ΩW and W'Ω(y − W b₀), for several fits to the same samples."""
    right = equations.right
    anchor = np.zeros_like(right) if prior is None else prior.hold
    if regularisation.anchor:
        held, target = _boundary(right.shape, regularisation.anchor)
        right = right + held * (target if prior is None else target - prior.values)
        anchor = anchor + held
    extra = None
    if regularisation.thin_plate:
        plate = thin_plate(equations.right.shape[:3])

        def extra(b: Array) -> Array:
            return regularisation.thin_plate * plate(b)

    offset = np.zeros_like(right) if prior is None else prior.values
    first = np.zeros_like(right) if start is None else start - offset
    multigrid = Multigrid(levels, equations.stencil, anchor, regularisation.smoothness, regularisation.twist)
    difference, iterations = solve(multigrid, right, first, tolerance, extra)
    return LatticeFit(levels, offset + difference, iterations)


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
