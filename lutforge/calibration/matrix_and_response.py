"""Matrix Ts and response f from RAW/JPEG pairs directly, in one robust least-squares fit.

f⁻¹(I) = Ts x with x = Tw E holds where the gamut map leaves a colour alone. It is linear in Ts and in the table of
f⁻¹, so each round is a small bounded least-squares problem: f⁻¹ as a sum of non-negative steps (monotone by
construction), Ts with rows that sum to 1 (neutrals stay neutral). Rounds re-weight by the slope of f, so that the
error counts in JPEG values, and by the residual (Cauchy, four times its median), so that a stray sample does not.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
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
RANK_TOLERANCE = 1e-14
"""Eigenvalues below this share of the largest are rounding errors."""
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


@njit(cache=True, nogil=True)
def _equations(position: Array, own: Array, one: Array, two: Array, weight: Array) -> Array:
    """The symmetric (KNOTS + 3, KNOTS + 3) products, over all samples, of weighted rows of
    [f⁻¹'s interpolation between its knots, −differences to the two other channels, what they should sum to].

    position: of the encoded values in knots, (n,); own, one, two: x of this channel and of the others, (n,).
    """
    total = np.zeros((KNOTS + 3, KNOTS + 3))
    index, value = np.empty(5, dtype=np.int64), np.empty(5)
    for n in range(len(position)):
        cell = min(int(position[n]), KNOTS - 2)
        fraction = position[n] - cell
        index[0], index[1], index[2], index[3], index[4] = cell, cell + 1, KNOTS, KNOTS + 1, KNOTS + 2
        value[0], value[1] = 1.0 - fraction, fraction
        value[2], value[3], value[4] = own[n] - one[n], own[n] - two[n], own[n]
        for p in range(5):
            scaled = weight[n] * value[p]
            for q in range(5):
                total[index[p], index[q]] += scaled * value[q]
    return total


def _fit_channel(x: Array, encoded: Array, channel: int, weight: Array, shape: Array) -> tuple[Array, Array]:
    """f⁻¹ (KNOTS,) and the matrix row (3,) of one channel: minimise Σ w (f⁻¹(I) − m·x)², Σ m = 1.

    shape (KNOTS,): the curve whose second differences f⁻¹ takes where there are no samples.
    """
    others = [c for c in range(3) if c != channel]
    position = np.clip(encoded, 0.0, 1.0) * (KNOTS - 1)
    products = _equations(position, x[:, channel], x[:, others[0]], x[:, others[1]], weight)
    # From the values of f⁻¹ at its knots to its start and its steps.
    steps = np.eye(KNOTS + 3)
    steps[:KNOTS, :KNOTS] = np.tri(KNOTS)
    products = steps.T @ products @ steps
    normal, right = products[:-1, :-1], products[:-1, -1]
    bend = np.zeros((KNOTS - 2, KNOTS + 2))
    bend[:, 1:KNOTS] = np.diff(np.eye(KNOTS - 1), axis=0) * (np.sqrt(SMOOTHNESS * weight.sum()) * (KNOTS - 1))
    normal += bend.T @ bend
    right += bend.T @ (bend[:, 1:KNOTS] @ np.diff(shape))
    normal[KNOTS:, KNOTS:] += RIDGE * weight.sum() * np.eye(2)
    solution = _bounded(normal, right)
    table = solution[0] + np.concatenate([[0.0], np.cumsum(solution[1:KNOTS])])
    row = np.zeros(3)
    row[others] = solution[KNOTS:]
    row[channel] = 1.0 - row.sum()
    return table, row


LOWER = np.concatenate([[0.0], LEAST_STEP * np.diff(_srgb_decoded(np.linspace(0.0, 1.0, KNOTS))), [-3.0, -3.0]])
UPPER = np.concatenate([[0.05], np.full(KNOTS - 1, np.inf), [3.0, 3.0]])


def _bounded(normal: Array, right: Array) -> Array:
    """min u'Nu − 2 r'u with LOWER ≤ u ≤ UPPER, for N positive semidefinite."""
    try:
        free = cho_solve(cho_factor(normal, check_finite=False), right, check_finite=False)
        if np.all((free >= LOWER) & (free <= UPPER)):
            return np.asarray(free)
    except LinAlgError:  # the samples do not tell every unknown
        pass
    values, vectors = np.linalg.eigh(normal)
    told = values > RANK_TOLERANCE * values[-1]
    root = np.sqrt(values[told])[:, None]
    return np.asarray(
        lsq_linear(root * vectors[:, told].T, (vectors[:, told].T @ right) / root[:, 0], (LOWER, UPPER)).x
    )
