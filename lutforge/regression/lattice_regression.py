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
from numba import njit
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.regression.blas import one_blas_thread
from lutforge.regression.multigrid import (
    COARSEST,
    Level,
    Multigrid,
    Transfer,
    coarse_nodes,
    coarse_stencil,
    interpolation_matrix,
    restrict,
    to_bands,
)
from lutforge.regression.normal_equations import NormalEquations, normal_equations
from lutforge.regression.smoothness import first_difference, second_difference, thin_plate

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


@one_blas_thread
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
    size = equations.right.shape[:3]
    held, target = _boundary(equations.right.shape, regularisation.anchor)
    anchor = held
    right = equations.right + held * target
    if prior is not None:
        anchor = held + prior.hold
        right -= held * prior.values
    extra = None
    if regularisation.thin_plate:
        plate = thin_plate(size)

        def extra(b: Array) -> Array:
            return regularisation.thin_plate * plate(b)

    offset = np.zeros_like(right) if prior is None else prior.values
    first = np.zeros_like(right) if start is None else start - offset
    multigrid = hierarchy(levels, equations.stencil, anchor, regularisation)
    difference, iterations = multigrid.solve(right, first, tolerance, extra)
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


def hierarchy(levels: Levels, stencil: Array, anchor: Array, regularisation: Regularisation) -> Multigrid:
    """The operator of the data term `stencil`, the smoothness terms and the diagonal `anchor`, on the lattice and on
    ever coarser ones.

    stencil: (N_r, N_g, N_b, 27), not changed; anchor: (N_r, N_g, N_b, 3).
    """
    penalties = [regularisation.smoothness * (rows.T @ rows) for rows in map(second_difference, levels)]
    masses = [np.ones(len(axis)) for axis in levels]
    if regularisation.twist:
        stencil = stencil.copy()
        _add_twist(stencil, regularisation.twist, *(_slopes(len(axis)) for axis in levels))
    stages: list[Level] = []
    transfers: list[Transfer] = []
    while True:
        r, g, b = (to_bands(penalty) for penalty in penalties)
        mr, mg, mb = masses
        stages.append(Level(stencil, (r, g, b), (mr, mg, mb), anchor))
        if max(len(axis) for axis in levels) <= COARSEST:
            return Multigrid(stages, transfers)
        kept = [coarse_nodes(len(axis)) for axis in levels]
        parts = [interpolation_matrix(axis, nodes) for axis, nodes in zip(levels, kept, strict=True)]
        (cr, fr, pr), (cg, fg, pg), (cb, fb, pb) = parts
        transfer = Transfer((cr, cg, cb), (fr, fg, fb))
        transfers.append(transfer)
        projections = (pr, pg, pb)
        penalties = [p.T @ penalty @ p for p, penalty in zip(projections, penalties, strict=True)]
        # What is diagonal stays so: the row sums of P'MP, which are at least as stiff as P'MP itself.
        masses = [p.T @ mass for p, mass in zip(projections, masses, strict=True)]
        anchor = restrict(anchor, transfer)
        stencil = coarse_stencil(stencil, transfer)
        r, g, b = (axis[nodes] for axis, nodes in zip(levels, kept, strict=True))
        levels = (r, g, b)


def _slopes(count: int) -> Array:
    """The Gram matrix of the first difference of one axis as a band (N, 3), offsets −1 … 1."""
    rows = first_difference(count)
    return np.ascontiguousarray(to_bands(rows.T @ rows)[:, 1:4])


@njit(cache=True, nogil=True)
def _add_twist(stencil: Array, weight: float, sr: Array, sg: Array, sb: Array) -> None:
    """Add λ_T T'T, the tensor products of the slopes of two axes, to the 27-point stencil in place."""
    for i in range(stencil.shape[0]):
        for j in range(stencil.shape[1]):
            for k in range(stencil.shape[2]):
                for one in range(3):
                    for two in range(3):
                        stencil[i, j, k, 9 * one + 3 * two + 1] += weight * sr[i, one] * sg[j, two]
                        stencil[i, j, k, 9 * one + 3 + two] += weight * sr[i, one] * sb[k, two]
                        stencil[i, j, k, 9 + 3 * one + two] += weight * sg[j, one] * sb[k, two]
