"""Linear least squares with linear inequality constraints (Lawson & Hanson, "Solving Least Squares Problems", ch. 23).

The problem LSI, min x'N x − 2 r'x subject to G x ≥ h, becomes the least-distance problem LDP through the Cholesky
factor of N, and that becomes a non-negative least-squares problem in as many unknowns as there are constraints.
"""

import numpy as np
from scipy.linalg import LinAlgError, cholesky, solve_triangular
from scipy.optimize import nnls

from lutforge.arrays import Array
from lutforge.errors import CalibrationError


def solve_lsi(normal: Array, right: Array, constraints: Array, bounds: Array) -> Array:
    """x (k,) that minimizes x' normal x − 2 right' x subject to constraints x ≥ bounds.

    normal: (k, k); right: (k,); constraints: (c, k); bounds: (c,). Raises CalibrationError where the equations do not
    determine x, no x satisfies the constraints, or the search for it reaches its limit.
    """
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    try:
        upper = cholesky(normal / np.outer(size, size) + 1e-13 * np.eye(len(right)))
    except LinAlgError as error:
        raise CalibrationError("the samples do not determine the response: they span too few tones") from error
    constraints = constraints / size
    turned = solve_triangular(upper, constraints.T, trans="T").T  # G R⁻¹, of R x
    projected = solve_triangular(upper, right / size, trans="T")
    solution, chosen = projected, np.zeros(len(bounds), dtype=np.bool_)
    slack = 1e-9 * np.maximum(np.linalg.norm(constraints, axis=1), 1e-300)
    while True:  # few constraints ever bind: only those that were violated enter the problem
        violated = (turned @ solution < bounds - slack) & ~chosen
        if not violated.any():  # what those that entered lack is rounding
            return np.asarray(solve_triangular(upper, solution) / size)
        chosen |= violated
        # The least-distance problem: of all z with near z ≥ lacking that of least norm
        near = turned[chosen]
        dual = np.vstack([near.T, bounds[chosen] - near @ projected])
        corner = np.zeros(len(dual))
        corner[-1] = 1.0
        try:
            residual = dual @ nnls(dual, corner)[0] - corner
        except RuntimeError as error:  # how SciPy says that its iterations did not suffice
            raise CalibrationError("the curve of the samples was not found within the limit of iterations") from error
        if residual[-1] > -1e-14:
            raise CalibrationError("no rising curve fits the samples: the shots contradict each other")
        solution = projected - residual[:-1] / residual[-1]
