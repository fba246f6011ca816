"""Lattice regression at given node levels (thesis 5.4; Garcia & Gupta, NIPS 2009).

b̂ = argmin ‖Ω^½ (W b − y)‖² + λ_S ‖S (b − b₀)‖² + λ_T ‖T (b − b₀)‖² + λ_A ρ(b) + λ_K b'Kb + ‖Λ (b − b₀)‖²

S is the second difference along each axis, T the mixed one across each pair of axes: together they smooth alike in all
directions, a thin plate in index space. b₀ is a prior lattice that the result continues where no sample reaches, Λ² how
firmly a node is held to it; without one b₀ = 0, which leaves the thesis's own objective (λ_T = Λ = 0).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.regression.multigrid import (
    COARSEST,
    Level,
    Multigrid,
    Transfer,
    coarse_nodes,
    interpolation_matrix,
    to_bands,
)
from lutforge.regression.normal_equations import normal_equations
from lutforge.regression.smoothness import first_difference, second_difference, thin_plate

Array = NDArray[np.float64]

AXIS_PAIRS = ((0, 1), (0, 2), (1, 2))


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
    finest = normal_equations(x, y, levels, method, weight)
    anchors, anchored = _boundary(finest.right.shape, regularisation.anchor)
    right = finest.right + anchored
    if prior is not None:
        anchors += prior.hold
        right += prior.hold * prior.values + _smoothness(prior.values, levels, regularisation)
    multigrid = _hierarchy(x, levels, method, weight, finest.stencil, anchors, regularisation)
    extra = None
    if regularisation.thin_plate:
        plate = thin_plate(finest.right.shape[:3])

        def extra(b: Array) -> Array:
            return regularisation.thin_plate * plate(b)

    if start is None:
        start = prior.values if prior is not None else np.zeros_like(right)
    values, iterations = multigrid.solve(right, start, tolerance, extra)
    return LatticeFit(levels, values, iterations)


def predict(fit: LatticeFit, x: Array, method: Interpolation = "trilinear") -> Array:
    """The fitted lattice at x (n, 3)."""
    return interpolate(x, fit.levels, fit.values, method)


def _boundary(shape: tuple[int, ...], weight: float) -> tuple[Array, Array]:
    """The diagonal and the right-hand side of λ_A ρ(b): black maps to black, a full channel to a full channel."""
    diagonal, right = np.zeros(shape), np.zeros(shape)
    if weight:
        diagonal[0, 0, 0, :] = weight
        for face in (np.s_[-1, :, :, 0], np.s_[:, -1, :, 1], np.s_[:, :, -1, 2]):
            diagonal[face] = weight
            right[face] = weight
    return diagonal, right


def _smoothness(b: Array, levels: Levels, regularisation: Regularisation) -> Array:
    """(λ_S S'S + λ_T T'T) b."""
    total = np.zeros_like(b)
    for axis, nodes in enumerate(levels):
        rows = second_difference(nodes)
        total += np.moveaxis(np.tensordot(rows.T @ rows, b, axes=(1, axis)), 0, axis)
    total *= regularisation.smoothness
    if regularisation.twist:
        for one, two in AXIS_PAIRS:
            part = b
            for axis in (one, two):
                rows = first_difference(len(levels[axis]))
                part = np.moveaxis(np.tensordot(rows.T @ rows, part, axes=(1, axis)), 0, axis)
            total += regularisation.twist * part
    return total


def _hierarchy(
    x: Array,
    levels: Levels,
    method: Interpolation,
    weight: Array | None,
    stencil: Array,
    anchor: Array,
    regularisation: Regularisation,
) -> Multigrid:
    """The operator on the lattice and on ever coarser ones, down to a few nodes per axis."""
    penalties = [regularisation.smoothness * (rows.T @ rows) for rows in map(second_difference, levels)]
    slopes = [rows.T @ rows for rows in (first_difference(len(axis)) for axis in levels)]
    masses = [np.ones(len(axis)) for axis in levels]
    stages: list[Level] = []
    transfers: list[Transfer] = []
    while True:
        r, g, b = (to_bands(penalty) for penalty in penalties)
        mr, mg, mb = masses
        if regularisation.twist:
            _add_twist(stencil, slopes, masses, regularisation.twist)
        stages.append(Level(stencil, (r, g, b), (mr, mg, mb), anchor))
        if max(len(axis) for axis in levels) <= COARSEST:
            return Multigrid(stages, transfers)
        kept = [coarse_nodes(len(axis)) for axis in levels]
        parts = [interpolation_matrix(axis, nodes) for axis, nodes in zip(levels, kept, strict=True)]
        (cr, fr, pr), (cg, fg, pg), (cb, fb, pb) = parts
        transfers.append(Transfer((cr, cg, cb), (fr, fg, fb)))
        projections = [pr, pg, pb]
        penalties = [p.T @ penalty @ p for p, penalty in zip(projections, penalties, strict=True)]
        slopes = [p.T @ slope @ p for p, slope in zip(projections, slopes, strict=True)]
        masses = [p.T @ mass for p, mass in zip(projections, masses, strict=True)]
        lumped = np.einsum("ia,jb,kc,ijkd->abcd", pr**2, pg**2, pb**2, anchor, optimize=True)
        anchor = np.ascontiguousarray(lumped)
        r, g, b = (axis[nodes] for axis, nodes in zip(levels, kept, strict=True))
        levels = (r, g, b)
        stencil = normal_equations(x, np.zeros_like(x), levels, method, weight).stencil


def _add_twist(stencil: Array, slopes: list[Array], masses: list[Array], weight: float) -> None:
    """Add λ_T T'T, tensor products of two tridiagonal matrices, to the 27-point stencil in place."""
    for one, two in AXIS_PAIRS:
        for d1 in (-1, 0, 1):
            for d2 in (-1, 0, 1):
                factors = []
                offset = [0, 0, 0]
                offset[one], offset[two] = d1, d2
                for axis in range(3):
                    if axis in (one, two):
                        band = np.zeros(len(masses[axis]))
                        values = np.diagonal(slopes[axis], offset[axis])
                        band[max(0, -offset[axis]) : len(band) - max(0, offset[axis])] = values
                        factors.append(band)
                    else:
                        factors.append(masses[axis])
                index = 9 * offset[0] + 3 * offset[1] + offset[2] + 13
                r, g, b = factors
                stencil[..., index] += weight * r[:, None, None] * g[None, :, None] * b[None, None, :]
