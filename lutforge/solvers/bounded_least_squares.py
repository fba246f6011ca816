"""Linear least squares with bounds or with linear inequality constraints.

With bounds, from the normal equations, by an active set (Kunisch & Rendl, SIAM J. Optim. 14, 2003): guess which bounds
hold, solve for the rest, exchange all that are wrong: a few small Cholesky factorisations. Where that goes round in
circles, or the equations do not tell every unknown, SciPy's general solver takes over.

With inequalities (Lawson & Hanson, "Solving Least Squares Problems", ch. 23): the problem LSI, min ‖A x − b‖ subject to
G x ≥ h, becomes the least-distance problem LDP through the QR factors of A, and that becomes a non-negative
least-squares problem in as many unknowns as there are constraints.
"""

import numpy as np
from scipy.linalg.lapack import dposv
from scipy.optimize import lsq_linear, nnls

from lutforge.arrays import Array, Mask
from lutforge.errors import CalibrationError
from lutforge.solvers.solution import Solution, Status


def bounded_least_squares(normal: Array, right: Array, lower: Array, upper: Array, like: Array | None = None) -> Array:
    """u (k,) that minimises u'Nu − 2 r'u with lower ≤ u ≤ upper.

    normal: N (k, k), positive semidefinite; right: r (k,); lower, upper: (k,); like: the solution of a like problem,
    whose bounds are the first guess. Time O(k³) an exchange.
    """
    low = high = np.zeros(len(right), dtype=np.bool_)
    if like is not None:
        low, high = like <= lower, like >= upper
    for _ in range(20):
        held = low | high
        system, target = (normal, right) if not held.any() else _with_fixed(normal, right, held, lower, upper, low)
        _, u, singular = dposv(system, target)
        if singular:
            break
        below, above = u < lower, u > upper
        if held.any():  # those stay whose bound still holds u back
            slope = normal @ u - right
            below, above = np.where(low, slope > 0.0, below), np.where(high, slope < 0.0, above)
        if np.array_equal(below, low) and np.array_equal(above, high):
            return np.asarray(u)
        low, high = below, above
    values, vectors = np.linalg.eigh(normal)
    told = values > 1e-14 * values[-1]  # smaller ones are rounding errors
    root = np.sqrt(values[told])[:, None]
    return np.asarray(
        lsq_linear(root * vectors[:, told].T, (vectors[:, told].T @ right) / root[:, 0], (lower, upper)).x
    )


def _with_fixed(normal: Array, right: Array, held: Mask, lower: Array, upper: Array, low: Mask) -> tuple[Array, Array]:
    """The equations with the held unknowns at their bounds: the lower one where low, else the upper."""
    at = np.where(low, lower, upper)
    at[~held] = 0.0
    system, target = normal.copy(), right - normal @ at
    system[held], system[:, held] = 0.0, 0.0
    system[held, held], target[held] = 1.0, at[held]
    return system, target


def solve_lsi(design: Array, target: Array, constraints: Array, bounds: Array) -> Array:
    """x (k,) that minimises ‖design x − target‖ subject to constraints x ≥ bounds.

    design: (m, k) of full column rank; constraints: (c, k); bounds: (c,).
    Raises CalibrationError where the design does not determine x, no x satisfies the constraints, or the search for it
    reaches its limit.
    """
    unknowns = design.shape[1]
    factor = np.asarray(np.linalg.qr(np.column_stack([design, target]), mode="r"))
    upper, projected = factor[:unknowns, :unknowns], factor[:unknowns, -1]
    diagonal = np.abs(np.diag(upper))
    if len(diagonal) < unknowns or diagonal.min() <= 1e-12 * max(diagonal.max(), 1e-300):
        raise CalibrationError("the samples do not determine the curve: they span too few tones")
    solution: Array = np.linalg.solve(upper, projected)
    turned = np.linalg.solve(upper.T, constraints.T).T  # G R⁻¹
    slack = 1e-9 * np.maximum(np.linalg.norm(constraints, axis=1), 1e-300)
    chosen = np.zeros(len(bounds), dtype=np.bool_)
    while True:  # few constraints ever bind: only those that were violated enter the problem
        violated = (constraints @ solution < bounds - slack) & ~chosen
        if not violated.any():  # what those that entered lack is rounding
            return solution
        chosen |= violated
        distance = least_distance(turned[chosen], bounds[chosen] - turned[chosen] @ projected)
        if distance.status is Status.INFEASIBLE:
            raise CalibrationError("no rising curve fits the samples: the shots contradict each other")
        if not distance.converged:
            raise CalibrationError(f"the curve of the samples was not found: {distance.status.value}")
        solution = np.linalg.solve(upper, distance.value + projected)


def least_distance(constraints: Array, bounds: Array) -> Solution:
    """Find z (k,) of least norm with constraints z ≥ bounds: the problem LDP, by non-negative least squares.

    constraints: (c, k); bounds: (c,). The solution's residual is the norm of z. INFEASIBLE: no z satisfies them.
    """
    dual = np.vstack([constraints.T, bounds])
    corner = np.zeros(len(dual))
    corner[-1] = 1.0
    nothing = np.zeros(len(dual) - 1)
    try:
        residual = dual @ nnls(dual, corner)[0] - corner
    except RuntimeError:  # how scipy says that its iterations did not suffice
        return Solution(nothing, Status.LIMIT, np.inf, 0)
    if residual[-1] > -1e-14:
        return Solution(nothing, Status.INFEASIBLE, np.inf, 0)
    distance = np.asarray(-residual[:-1] / residual[-1])
    return Solution(distance, Status.CONVERGED, float(np.linalg.norm(distance)), 0)
