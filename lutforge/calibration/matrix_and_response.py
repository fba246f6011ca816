"""Matrix Ts and response f from RAW/JPEG pairs directly, in one robust least-squares fit.

f⁻¹(I) = Ts x with x = Tw E holds where the gamut map leaves a colour alone. It is linear in Ts and in the table of
f⁻¹, so each round is a small bounded least-squares problem: f⁻¹ as a sum of non-negative steps (monotone by
construction), Ts with rows that sum to 1 (neutrals stay neutral). Rounds re-weight by the slope of f, so that the
error counts in JPEG values, and by the residual (Cauchy, four times its median), so that a stray sample does not.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.regression.blas import one_blas_thread

Array = NDArray[np.float64]

KNOTS = 33
"""Entries of the fitted f⁻¹ per channel; between them it is linear."""
ROUNDS = 8
LEAST_STEP = 0.05
"""f⁻¹ rises at least at this share of the rate of sRGB's own curve."""
SMOOTHNESS = 1e-3
"""Weight of the squared second difference of f⁻¹ less that of sRGB's own curve, relative to the number of samples."""
RIDGE = 1e-5
"""Weight of the squared entries of Ts off its diagonal: what colours cannot tell stays the identity."""
LEAST_SCALE = 2.0 / 255.0
"""The Cauchy scale is never below this: two JPEG codes."""


@dataclass(frozen=True, eq=False)
class MatrixAndResponse:
    """matrix: Ts (3, 3), rows sum to 1; response: f; inlier: (n,) weights in [0, 1]; rms: encoded, of the inliers."""

    matrix: Array
    response: Response
    inlier: Array
    rms: float

    def render(self, x: Array) -> Array:
        """White-balanced RAW (…, 3) → encoded (…, 3), in [0, 1]."""
        return self.response.encode(x @ self.matrix.T)

    def linearize(self, encoded: Array) -> Array:
        """Encoded (…, 3) → white-balanced RAW (…, 3), not clipped."""
        return self.response.linearize(encoded) @ np.linalg.inv(self.matrix).T


@one_blas_thread
def fit_matrix_and_response(x: Array, encoded: Array) -> MatrixAndResponse:
    """Fit Ts and f to white-balanced RAW x (n, 3) and JPEG values encoded (n, 3) in [0, 1].

    Raises CalibrationError where the samples cannot tell the matrix (too few, or all on one line).
    """
    count = len(x)
    if count < 10:
        raise CalibrationError(f"{count} samples cannot determine a matrix and a response; at least 10 are needed")
    weight = np.ones(count)
    slope = np.ones((count, 3))
    tables, rows = np.zeros((KNOTS, 3)), np.eye(3)
    shape = _srgb_decoded(np.linspace(0.0, 1.0, KNOTS))
    rms = 0.0
    for _ in range(ROUNDS):
        for channel in range(3):
            tables[:, channel], rows[channel] = _fit_channel(
                x, encoded[:, channel], channel, weight * slope[:, channel] ** 2, shape
            )
        shape = tables.mean(axis=1)  # where one channel has no samples, it bends as the others do
        response = Response(tables.copy())
        linear = x @ rows.T
        residual = np.linalg.norm(response.encode(linear) - encoded, axis=1)
        scale = max(4.0 * float(np.median(residual)), LEAST_SCALE)
        weight = 1.0 / (1.0 + (residual / scale) ** 2)
        rms = float(np.sqrt(np.average(residual**2, weights=weight)))
        slope = _encoding_slope(tables, encoded)
    return MatrixAndResponse(rows.copy(), response, weight, rms)


def _encoding_slope(tables: Array, encoded: Array) -> Array:
    """df/d(linear) at the samples, bounded so that no dark sample outweighs all others."""
    codes = np.linspace(0.0, 1.0, KNOTS)
    step = np.gradient(tables, codes, axis=0)
    slope = np.stack([np.interp(encoded[:, c], codes, step[:, c]) for c in range(3)], axis=1)
    bounded: Array = 1.0 / np.maximum(slope, 0.05)
    return bounded


def _srgb_decoded(encoded: Array) -> Array:
    """IEC 61966-2-1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def _fit_channel(x: Array, encoded: Array, channel: int, weight: Array, shape: Array) -> tuple[Array, Array]:
    """f⁻¹ (KNOTS,) and the matrix row (3,) of one channel: minimise Σ w (f⁻¹(I) − m·x)², Σ m = 1.

    shape (KNOTS,): the curve whose second differences f⁻¹ takes where there are no samples.
    """
    others = [c for c in range(3) if c != channel]
    position = np.clip(encoded, 0.0, 1.0) * (KNOTS - 1)
    # f⁻¹(I) = start + Σ steps up to I: how much of each step lies below a sample.
    steps = np.clip(position[:, None] - np.arange(KNOTS - 1)[None, :], 0.0, 1.0)
    differences = x[:, others] - x[:, [channel]]
    design = np.column_stack([np.ones(len(x)), steps, -differences])
    root = np.sqrt(weight)[:, None]
    bend = np.zeros((KNOTS - 2, design.shape[1]))
    index = np.arange(KNOTS - 2)
    bend[index, index + 1], bend[index, index + 2] = -1.0, 1.0
    bend *= np.sqrt(SMOOTHNESS * weight.sum()) * (KNOTS - 1)
    ridge = np.zeros((2, design.shape[1]))
    ridge[:, KNOTS:] = np.sqrt(RIDGE * weight.sum()) * np.eye(2)
    system = np.vstack([design * root, bend, ridge])
    wanted = bend[:, 1:KNOTS] @ np.diff(shape)
    target = np.concatenate([x[:, channel] * root[:, 0], wanted, np.zeros(2)])
    # The QR factor holds the same problem in as many rows as unknowns.
    factor = np.asarray(np.linalg.qr(np.column_stack([system, target]), mode="r"))
    lower = np.concatenate([[0.0], LEAST_STEP * np.diff(_srgb_decoded(np.linspace(0.0, 1.0, KNOTS))), [-3.0, -3.0]])
    upper = np.concatenate([[0.05], np.full(KNOTS - 1, np.inf), [3.0, 3.0]])
    solution = lsq_linear(factor[:-1, :-1], factor[:-1, -1], bounds=(lower, upper)).x
    table = solution[0] + np.concatenate([[0.0], np.cumsum(solution[1:KNOTS])])
    row = np.zeros(3)
    row[others] = solution[KNOTS:]
    row[channel] = 1.0 - row.sum()
    return table, row
