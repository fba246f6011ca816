"""Linear least squares with linear inequality constraints (Lawson & Hanson, "Solving Least Squares Problems", ch. 23).

The problem LSI, min ‖A x − b‖ subject to G x ≥ h, becomes the least-distance problem LDP through the QR factors of A,
and that becomes a non-negative least-squares problem in as many unknowns as there are constraints.
"""

import numpy as np
from scipy.optimize import nnls

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.solvers.solution import Solution, Status


def solve_lsi(design: Array, target: Array, constraints: Array, bounds: Array) -> Array:
    """x (k,) that minimizes ‖design x − target‖ subject to constraints x ≥ bounds.

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
