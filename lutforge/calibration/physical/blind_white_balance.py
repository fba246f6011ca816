"""White-balance multipliers from colours alone, where a file tells none and shows nothing neutral.

f⁻¹(I) = A E with one response f for the three channels and A = Ts Tw: linear in A and in the table of f⁻¹ (fixed by
f⁻¹(1) = 1), so it is one bounded least-squares problem, re-weighted a few times by the slope of f and by the residual.
The RAW that renders neutral is A⁻¹ (1, 1, 1), and the multipliers are its reciprocals.
"""

import numpy as np
from scipy.optimize import lsq_linear

from lutforge.arrays import Array
from lutforge.errors import CalibrationError
from lutforge.solvers.robust_weights import RobustWeights, cauchy


def multipliers_from_colours(raw: Array, encoded: Array) -> Array:
    """Multipliers (3,) with green = 1 from RAW (n, 3) and JPEG values (n, 3) of any colours under one white balance.

    Raises CalibrationError where the colours do not determine them: too few, or all alike.
    """
    count = len(raw)
    if count < 24 or np.linalg.matrix_rank(raw - raw.mean(axis=0), tol=1e-3 * np.sqrt(count)) < 3:
        raise CalibrationError(f"{count} colours, too few or too alike to tell a white balance from")
    weight = np.ones((count, 3))
    matrix, codes = np.eye(3), np.linspace(0.0, 1.0, 17)
    robust = RobustWeights(cauchy, multiple=4.0, least=2.0 / 255.0)
    for _ in range(4):
        table, matrix = _fit(raw, encoded, weight, len(codes) - 1)
        rendered = np.interp(raw @ matrix.T, table, codes)
        residual = np.linalg.norm(rendered - encoded, axis=1)
        slope = np.interp(encoded, codes, np.gradient(table, codes))
        weight = np.sqrt(robust(residual))[:, None] / np.maximum(slope, 0.05)
    neutral = np.linalg.solve(matrix, np.ones(3))
    if not np.all(neutral > 0) or not np.all((neutral[1] / neutral > 0.1) & (neutral[1] / neutral < 10)):
        raise CalibrationError("the colours contradict any white balance: is the JPEG the camera's own?")
    multipliers: Array = neutral[1] / neutral
    return multipliers


def _fit(raw: Array, encoded: Array, weight: Array, steps: int) -> tuple[Array, Array]:
    """f⁻¹ (steps + 1,) and A (3, 3): minimize Σ w² (f⁻¹(I_c) − a_c·E)² with f⁻¹ rising from 0 to 1."""
    count = len(raw)
    design = np.zeros((3 * count, steps + 9))
    position = np.clip(encoded, 0.0, 1.0) * steps
    for channel in range(3):
        rows = slice(channel * count, (channel + 1) * count)
        design[rows, :steps] = np.clip(position[:, [channel]] - np.arange(steps), 0.0, 1.0)
        design[rows, steps + 3 * channel : steps + 3 * channel + 3] = -raw
    total = float(np.sum(weight**2))
    bend = np.zeros((steps - 1, steps + 9))
    index = np.arange(steps - 1)
    bend[index, index], bend[index, index + 1] = -1.0, 1.0
    # the weight of the curve's bends beside that of all samples
    bend *= np.sqrt(1e-3 * total) * steps
    top = np.zeros((1, steps + 9))
    top[0, :steps] = 1e4 * np.sqrt(total)  # f⁻¹(1) = 1, all but exactly
    system = np.vstack([design * weight.T.reshape(-1, 1), bend, top])
    target = np.zeros(len(system))
    target[-1] = top[0, 0]
    factor = np.asarray(np.linalg.qr(np.column_stack([system, target]), mode="r"))
    lower = np.concatenate([np.full(steps, 1e-6), np.full(9, -np.inf)])
    solution = lsq_linear(factor[:-1, :-1], factor[:-1, -1], bounds=(lower, np.full(steps + 9, np.inf))).x
    return np.concatenate([[0.0], np.cumsum(solution[:steps])]), solution[steps:].reshape(3, 3)
