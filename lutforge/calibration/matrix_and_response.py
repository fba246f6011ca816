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

from lutforge.calibration.bounded_least_squares import bounded_least_squares
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.regression.blas import one_blas_thread

Array = NDArray[np.float64]

KNOTS = 33
"""Entries of the fitted f⁻¹ per channel; between them it is linear."""
ROUNDS, FEW, LAST_ROUNDS = 8, 3_000, 2
"""Of more than FEW samples, so many go through all rounds, and all through the last ones."""
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
    x, encoded = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(encoded, dtype=np.float64)
    weight, slope = np.ones(count), np.ones((count, 3))
    tables, rows = np.zeros((KNOTS, 3)), np.eye(3)
    shape = _srgb_decoded(np.linspace(0.0, 1.0, KNOTS))
    rounds = ROUNDS
    if count > FEW:
        few = np.random.default_rng(0).choice(count, FEW, replace=False, shuffle=False)
        shape, *_ = _rounds(x[few], encoded[few], np.ones(FEW), np.ones((FEW, 3)), tables, rows, shape, ROUNDS)
        weight, _ = _weights(x, encoded, tables, rows, slope)
        rounds = LAST_ROUNDS
    _, weight, rms = _rounds(x, encoded, weight, slope, tables, rows, shape, rounds)
    return MatrixAndResponse(rows.copy(), Response(tables), weight, rms)


def _rounds(
    x: Array, encoded: Array, weight: Array, slope: Array, tables: Array, rows: Array, shape: Array, rounds: int
) -> tuple[Array, Array, float]:
    """Improve tables (KNOTS, 3) and matrix rows (3, 3) in place; returns the curve that channels without samples bend
    by, the weights (n,), and their rms."""
    rms = 0.0
    for _ in range(rounds):
        for channel in range(3):
            tables[:, channel], rows[channel] = _fit_channel(x, encoded, channel, weight, slope, shape)
        shape = tables.mean(axis=1)  # where one channel has no samples, it bends as the others do
        weight, rms = _weights(x, encoded, tables, rows, slope)
    return shape, weight, rms


def _weights(x: Array, encoded: Array, tables: Array, rows: Array, slope: Array) -> tuple[Array, float]:
    """Cauchy weights (n,) of samples, and the rms of their residuals with these; fills the slopes (n, 3)."""
    residual = _residual(x @ rows.T, encoded, tables, slope)
    scale = max(4.0 * float(np.median(residual)), LEAST_SCALE)
    weight = 1.0 / (1.0 + (residual / scale) ** 2)
    return weight, float(np.sqrt((residual**2 @ weight) / weight.sum()))


@njit(cache=True, nogil=True)
def _residual(linear: Array, encoded: Array, tables: Array, slope: Array) -> Array:
    """(n,): the distance of f(linear) from the encoded values, (n, 3), with f⁻¹ as tables (KNOTS, 3).

    slope: filled with df/d(linear) at these, (n, 3), bounded so that no dark sample outweighs all others.
    """
    rise = np.empty((KNOTS, 3))
    for knot in range(KNOTS):
        low, high = max(knot - 1, 0), min(knot + 1, KNOTS - 1)
        for c in range(3):
            rise[knot, c] = (tables[high, c] - tables[low, c]) * ((KNOTS - 1) / (high - low))
    residual = np.empty(len(linear))
    for n in range(len(linear)):
        total = 0.0
        for c in range(3):
            cell, fraction = _cell(encoded[n, c])
            slope[n, c] = 1.0 / max(rise[cell, c] + fraction * (rise[cell + 1, c] - rise[cell, c]), 0.05)
            value = linear[n, c]
            while cell > 0 and value < tables[cell, c]:  # from where the fit should have it
                cell -= 1
            while cell < KNOTS - 2 and value >= tables[cell + 1, c]:
                cell += 1
            width = tables[cell + 1, c] - tables[cell, c]
            part = (value - tables[cell, c]) / width if width > 0.0 else 1.0
            total += ((cell + min(max(part, 0.0), 1.0)) / (KNOTS - 1) - encoded[n, c]) ** 2
        residual[n] = np.sqrt(total)
    return residual


@njit(cache=True, nogil=True)
def _cell(encoded: float) -> tuple[int, float]:
    """The knot below an encoded value, and the fraction from there to the next."""
    position = min(max(encoded, 0.0), 1.0) * (KNOTS - 1)
    cell = min(int(position), KNOTS - 2)
    return cell, position - cell


def _srgb_decoded(encoded: Array) -> Array:
    """IEC 61966-2-1."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


@njit(cache=True, nogil=True)
def _equations(x: Array, encoded: Array, channel: int, weight: Array, slope: Array) -> tuple[Array, float]:
    """The symmetric (KNOTS + 3, KNOTS + 3) products, over all samples, of weighted rows of
    [f⁻¹'s interpolation between its knots, −differences to the two other channels, what they should sum to], and the
    sum of the weights. The weight of a sample is weight · slope², of the channel.
    """
    total = np.zeros((KNOTS + 3, KNOTS + 3))
    one, two, weights = (channel == 0) + 0, 2 - (channel == 2), 0.0
    value = np.empty(5)
    for n in range(len(x)):
        cell, fraction = _cell(encoded[n, channel])
        own, w = x[n, channel], weight[n] * slope[n, channel] ** 2
        value[0], value[1] = 1.0 - fraction, fraction
        value[2], value[3], value[4] = own - x[n, one], own - x[n, two], own
        for p in range(5):
            scaled = w * value[p]
            row = cell + p if p < 2 else KNOTS + p - 2
            if p < 2:
                for q in range(p, 2):
                    total[row, cell + q] += scaled * value[q]
            for q in range(max(p, 2), 5):
                total[row, KNOTS + q - 2] += scaled * value[q]
        weights += w
    for row in range(KNOTS + 3):
        for column in range(row):
            total[row, column] = total[column, row]
    return total, weights


STEPS = np.eye(KNOTS + 3)
"""From the values of f⁻¹ at its knots to its start and its steps."""
STEPS[:KNOTS, :KNOTS] = np.tri(KNOTS)
BEND = np.zeros((KNOTS - 2, KNOTS + 2))
"""The second difference of f⁻¹ at unit spacing of encoded values, of its steps."""
BEND[:, 1:KNOTS] = np.diff(np.eye(KNOTS - 1), axis=0) * (KNOTS - 1)
BENDING = BEND.T @ BEND


def _fit_channel(
    x: Array, encoded: Array, channel: int, weight: Array, slope: Array, shape: Array
) -> tuple[Array, Array]:
    """f⁻¹ (KNOTS,) and the matrix row (3,) of one channel: minimise Σ w (f⁻¹(I) − m·x)², Σ m = 1.

    shape (KNOTS,): the curve whose second differences f⁻¹ takes where there are no samples.
    """
    products, total = _equations(x, encoded, channel, weight, slope)
    products = STEPS.T @ products @ STEPS
    normal, right = products[:-1, :-1], products[:-1, -1].copy()
    normal += SMOOTHNESS * total * BENDING
    right += SMOOTHNESS * total * (BENDING[:, 1:KNOTS] @ np.diff(shape))
    normal[KNOTS:, KNOTS:] += RIDGE * total * np.eye(2)
    solution = bounded_least_squares(normal, right, LOWER, UPPER)
    table = solution[0] + np.concatenate([[0.0], np.cumsum(solution[1:KNOTS])])
    row = np.zeros(3)
    row[[c for c in range(3) if c != channel]] = solution[KNOTS:]
    row[channel] = 1.0 - row.sum()
    return table, row


LOWER = np.concatenate([[0.0], LEAST_STEP * np.diff(_srgb_decoded(np.linspace(0.0, 1.0, KNOTS))), [-3.0, -3.0]])
UPPER = np.concatenate([[0.05], np.full(KNOTS - 1, np.inf), [3.0, 3.0]])
