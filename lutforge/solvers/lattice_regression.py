"""Lattice regression at given node levels (thesis 5.4; Garcia & Gupta, NIPS 2009).

b̂ = argmin ‖Ω^½ (W b − y)‖² + λ_S ‖S (b − b₀)‖² + λ_T ‖T (b − b₀)‖² + λ_A ρ(b)
            + λ_K (b − b₀)'K (b − b₀) + ‖Λ (b − b₀)‖²

S is the second difference along each axis, T the mixed one across each pair of axes: together they smooth alike in all
directions, a thin plate in index space. b₀ is a prior mean that the result continues where no sample reaches, Λ² its
weight at each node; without one b₀ = 0, which leaves the thesis's own objective (λ_T = Λ = 0). Solved is for
b − b₀, from the samples' differences to the prior.

The equations are sparse, and the diagonal preconditions them well where a prior holds every node. Without one, nodes
far from all samples are held by smoothness alone, and a coarse lattice tells what is smooth at once.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from scipy import sparse

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.interpolation import Interpolation, Levels, interpolate
from lutforge.solvers import diagonals
from lutforge.solvers.normal_equations import normal_equations
from lutforge.solvers.penalties import ThinPlate, smoothness_matrix, thin_plate
from lutforge.solvers.solution import Solution, Status
from lutforge.threads import one_blas_thread

Operator = Callable[[Array], Array]

COARSE = 9
"""Nodes per axis of the coarse lattice, whose equations are solved densely, in a tenth of a second. With it the
thesis's equations of 33³ nodes take some 250 iterations instead of 4,000."""


@dataclass(frozen=True)
class Regularization:
    """The weights of the terms beside the data.

    smoothness: λ_S, of second differences; mixed: λ_T, of mixed second differences; anchor: λ_A, of the boundary term;
    thin_plate: λ_K.
    """

    smoothness: float = 0.0
    mixed: float = 0.0
    anchor: float = 0.0
    thin_plate: float = 0.0


NOTHING_ELSE = Regularization()


@dataclass(frozen=True, eq=False)
class Prior:
    """A prior mean b₀ of the node values, and its weight Λ² ≥ 0, both (N_r, N_g, N_b, 3)."""

    values: Array
    weight: Array


@one_blas_thread
def fit_lattice(
    x: Array,
    y: Array,
    levels: Levels,
    regularization: Regularization = NOTHING_ELSE,
    *,
    method: Interpolation = "trilinear",
    weight: Array | None = None,
    prior: Prior | None = None,
    start: Array | None = None,
    tolerance: float = 1e-8,
    most: int = 2000,
) -> Solution:
    """Fit node values (N_r, N_g, N_b, 3) to samples x (n, 3) in [0, 1] → y (n, 3), at the given node levels.

    weight: Ω, (n,); start: a first guess of the values; tolerance: of the residual relative to the right-hand side;
    most: iterations at most. Time O(n) to assemble, O(N³) per iteration. Raises CalibrationError where the iterations
    leave a residual far from the tolerance.
    """
    offset = 0.0 if prior is None else prior.values
    difference = y if prior is None else y - interpolate(x, levels, prior.values, method)
    equations = normal_equations(x, difference, levels, method, weight)
    right, matrix = equations.right, equations.matrix
    shape = right.shape
    diagonal_weight = np.zeros(shape) if prior is None else prior.weight
    if regularization.anchor:
        on_ends, target = _boundary(shape, regularization.anchor)
        right, diagonal_weight = right + on_ends * (target - offset), diagonal_weight + on_ends
    if regularization.smoothness or regularization.mixed:
        matrix = matrix + smoothness_matrix(levels, regularization.smoothness, regularization.mixed)
    size, diagonal_weight = shape[:3], _planar(diagonal_weight)
    inverse = diagonal_weight + matrix.diagonal()
    plate = thin_plate((size[0], size[1], size[2]), regularization.thin_plate) if regularization.thin_plate else None
    if plate is not None:
        inverse += plate.diagonal().ravel()
    inverse = 1.0 / np.maximum(inverse, 1e-300)
    coarse = _coarse_solve(matrix, diagonal_weight.mean(axis=0), plate, levels) if prior is None else np.zeros_like

    def product(b: Array) -> Array:
        image = diagonals.product(matrix, diagonal_weight, b)
        return image if plate is None else image + plate(b.reshape(3, *size)).reshape(3, -1)

    solution = conjugate_gradients(
        product,
        lambda residual: inverse * residual + coarse(residual),
        _planar(right),
        _planar(np.zeros(shape) if start is None else start - offset),
        tolerance=tolerance,
        most=most,
    )
    if not solution.residual <= 1e3 * tolerance:  # what is nearer to the goal than that is of use
        raise CalibrationError(
            f"lattice regression: after {solution.iterations} iterations {solution.status.value}, with a residual of "
            f"{solution.residual:.1g}; the samples cover too little of colour space for this size: use a smaller --size"
        )
    return replace(solution, value=np.ascontiguousarray(offset + np.moveaxis(solution.value.reshape(3, *size), 0, 3)))


def conjugate_gradients(
    product: Operator, precondition: Operator, right: Array, start: Array, *, tolerance: float, most: int
) -> Solution:
    """Solve A b = right for right-hand sides (c, n), each row a system of its own, from `start`.

    product: A b; precondition: M r of a residual, M ≈ A⁻¹; both symmetric, positive definite, and linear. tolerance:
    norm of the residual relative to that of the right-hand side, for every system; most: iterations at most. The
    solution's residual is that ratio, the largest of all systems. Hestenes & Stiefel 1952; Saad, "Iterative Methods for
    Sparse Linear Systems", 2003, algorithm 9.1.
    """
    b, residual = start, right - product(start)
    direction, rho, iteration = np.zeros_like(right), np.full(len(right), np.inf), 0
    scale = np.maximum(np.linalg.norm(right, axis=1), 1e-150)
    while iteration < most and np.any(np.linalg.norm(residual, axis=1) > tolerance * scale):
        preconditioned, before = precondition(residual), rho
        rho = np.einsum("cn,cn->c", residual, preconditioned)
        direction = preconditioned + (rho / np.maximum(before, 1e-300))[:, None] * direction
        image = product(direction)
        step = (rho / np.maximum(np.einsum("cn,cn->c", direction, image), 1e-300))[:, None]
        b, residual, iteration = b + step * direction, residual - step * image, iteration + 1
    largest = float(np.max(np.linalg.norm(residual, axis=1) / scale))
    if not np.isfinite(largest):
        return Solution(b, Status.SINGULAR, largest, iteration)
    return Solution(b, Status.CONVERGED if largest <= tolerance else Status.LIMIT, largest, iteration)


def _coarse_solve(
    matrix: sparse.dia_array, diagonal_weight: Array, plate: ThinPlate | None, levels: Levels
) -> Operator:
    """The correction P (P'AP)⁻¹ P' r by a lattice of at most COARSE nodes per axis, P its trilinear interpolation."""
    kept = [axis[np.unique(np.rint(np.linspace(0, len(axis) - 1, COARSE)).astype(int))] for axis in levels]
    units = [np.eye(len(axis)) for axis in kept]
    along = [np.stack([np.interp(levels[c], kept[c], unit) for unit in units[c]], axis=1) for c in range(3)]
    prolong = sparse.csr_array(sparse.kron(sparse.kron(along[0], along[1]), along[2]))
    square = (prolong.T @ (matrix @ prolong + prolong * diagonal_weight[:, None])).toarray()
    count = len(square)
    if plate is not None:
        square += plate.through(along)(np.eye(count).reshape(count, *map(len, kept))).reshape(count, count)
    # If smoothness alone acts on the nodes, the equations are singular; the small diagonal makes them solvable.
    factors = scipy.linalg.cho_factor(square + 1e-10 * square.diagonal().max(initial=1e-290) * np.eye(count))
    return lambda residual: np.asarray((prolong @ scipy.linalg.cho_solve(factors, prolong.T @ residual.T)).T)


def _planar(values: Array) -> Array:
    """Node values (N_r, N_g, N_b, 3) as a contiguous lattice per output, (3, nodes), of which products are faster."""
    return np.ascontiguousarray(values.reshape(-1, 3).T)


def _boundary(shape: tuple[int, ...], weight: float) -> tuple[Array, Array]:
    """λ_A ρ(b) as a diagonal and the values that it draws to: black to black, a full channel to a full channel."""
    diagonal, target = np.zeros(shape), np.zeros(shape)
    diagonal[0, 0, 0, :] = weight
    for face in (np.s_[-1, :, :, 0], np.s_[:, -1, :, 1], np.s_[:, :, -1, 2]):
        diagonal[face] = weight
        target[face] = 1.0
    return diagonal, target
