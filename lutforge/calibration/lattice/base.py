"""Fit the base of a lattice, the matrix Ts and the response f that it continues, by bounded least squares.

f⁻¹(I) = Ts x with x = Tw E holds where the gamut map leaves a colour alone. It is linear in Ts and in the table of
f⁻¹, so each round is a small bounded least-squares problem: f⁻¹ as a sum of non-negative steps (monotone by
construction), Ts with rows that sum to 1 (neutrals stay neutral). Which colours the gamut map moves is not known; it
moves grey ones least, so a sample counts by its saturation (`untouched_odds`) and by its residual, on a scale that
shrinks to that of the noise: from all colours alike, where most are saturated, f is tens of codes off. Rounds also
re-weight by the slope of f, so that the error counts in JPEG values. What no sample tells is the curve that the
channels have in common, and the shape of sRGB's.

`physical.matrix_and_response` fits the same two by general least squares, which holds better on sets of dark exposures
and takes ten times as long. Beneath a lattice it is worse: D40 17³ RAW → JPEG 0.00286 for 0.00279, JPEG → RAW 0.00137
for 0.00127, S40 0.0157 for 0.0145.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse
from lutforge.calibration.physical.unsaturated import saturation, untouched_odds
from lutforge.colour.srgb import srgb_decode
from lutforge.compiled import compiled
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.bounded_least_squares import bounded_least_squares
from lutforge.solvers.solution import Status

KNOTS = 33
"""Entries of the fitted f⁻¹ per channel; between them it is linear."""
FLATTEST = 0.05
"""Slopes of f⁻¹ below this count as this, so that no dark sample outweighs all others."""
RIDGE = 1e-7
"""Weight of the squared off-diagonal entries of Ts: where colours do not determine Ts, it stays the identity."""


@one_blas_thread
def fit_base(x: Array, encoded: Array) -> MatrixAndResponse:
    """Fit Ts and f to white-balanced RAW x (n, 3) and JPEG values encoded (n, 3) in [0, 1].

    Raises CalibrationError where the samples cannot tell the matrix (too few, or all on one line).
    """
    count = len(x)
    if count < 10:
        raise CalibrationError(f"{count} samples cannot determine a matrix and a response; at least 10 are needed")
    x, encoded = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(encoded, dtype=np.float64)
    few, odds = _unsaturated(x)
    rounds = 10
    tables, rows = _rounds(x[few], encoded[few], odds, rounds)
    residual, _ = _residual(x @ rows.T, encoded, tables)
    weight = _cauchy(residual)
    rms = float(np.sqrt((residual**2 @ weight) / weight.sum()))
    return MatrixAndResponse(rows, Response(tables), weight, weight, rms, Status.LIMIT, rounds)


@one_blas_thread
def with_matrix_of_all(base: MatrixAndResponse, x: Array, encoded: Array) -> MatrixAndResponse:
    """Fit the matrix anew to all samples, saturated ones too, and keep the response.

    x and encoded are (n, 3), as in the fit.
    """
    x, encoded = np.ascontiguousarray(x, dtype=np.float64), np.ascontiguousarray(encoded, dtype=np.float64)
    linear, tables = base.response.linearize(encoded), np.ascontiguousarray(base.response.inverse)
    rows = base.matrix
    residual, slope = _residual(x @ rows.T, encoded, tables)
    for _ in range(6):
        rows = _matrix(x, linear, _cauchy(residual), slope)
        residual, slope = _residual(x @ rows.T, encoded, tables)
    weight = _cauchy(residual)
    return replace(base, matrix=rows, inlier=weight, rms=float(np.sqrt((residual**2 @ weight) / weight.sum())))


def _unsaturated(x: Array) -> tuple[NDArray[np.intp], Array]:
    """The samples to fit, of x (n, 3), and their odds of being untouched by the gamut map, squared.

    At a saturation of 0.2 a sample counts a quarter, or at more where fewer than 100 lie below; beyond three times that
    it counts nothing. At most 3,000 are fitted, chosen among 50,000.
    """
    rng, rows, candidates, few = np.random.default_rng(0), np.arange(len(x)), 50_000, 3_000
    if len(x) > candidates:
        rows = rng.choice(len(x), candidates, replace=False, shuffle=False)
    chroma = saturation(x[rows])
    place = min(100, len(rows)) - 1
    beta = max(0.2, float(np.partition(chroma, place)[place]))
    near = np.flatnonzero(chroma < 3.0 * beta)
    if len(near) > few:
        near = rng.choice(near, few, replace=False, shuffle=False)
    return rows[near], untouched_odds(chroma[near], beta) ** 2


def _rounds(x: Array, encoded: Array, odds: Array, count: int) -> tuple[Array, Array]:
    """Tables of f⁻¹ (KNOTS, 3) and matrix rows (3, 3).

    A residual of three times the median of the unsaturated counts a quarter (Geman-McClure), but not one below `least`,
    which shrinks from round to round: where a stray sample bends the first fits, those that it bends away from are not
    yet lost.
    """
    tables, rows = np.zeros((KNOTS, 3)), np.eye(3)
    srgb = srgb_decode(np.linspace(0.0, 1.0, KNOTS))
    lower = np.concatenate([[0.0], 0.05 * np.diff(srgb), [-3.0, -3.0]])  # f⁻¹ rises at 1/20 of sRGB's rate at least
    upper = np.concatenate([[0.05], np.full(KNOTS - 1, np.inf), [3.0, 3.0]])
    common, alike, weight, slope, least = srgb, 0.0, odds, np.ones_like(x), 32.0 / 255.0
    start: list[Array | None] = [None] * 3
    for _ in range(count):
        normal, right = _systems(x, encoded, weight, slope, *_prior(common, alike))
        for channel in range(3):
            start[channel] = solution = bounded_least_squares(
                normal[channel], right[channel], lower, upper, start[channel]
            )
            tables[:, channel], mix = np.cumsum(solution[:KNOTS]), solution[KNOTS:]
            others = [other for other in range(3) if other != channel]
            rows[channel, others], rows[channel, channel] = mix, 1.0 - mix.sum()
        common, alike = tables.mean(axis=1), 0.01  # the weight of each knot's difference from the common curve
        residual, slope = _residual(x @ rows.T, encoded, tables)
        scale = max(3.0 * _weighted_median(residual, odds), least)
        weight = odds / (1.0 + (residual / scale) ** 2) ** 2
        least = max(0.6 * least, 0.5 / 255.0)
    return tables, rows


def _weighted_median(values: Array, weight: Array) -> float:
    order = np.argsort(values)
    total = np.cumsum(weight[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def _cauchy(residual: Array) -> Array:
    """Weights (n,) of all samples by their residuals (n,), in JPEG values.

    One with four times their median residual, and at least two codes, counts half.
    """
    scale = max(4.0 * float(np.median(residual)), 2.0 / 255.0)
    return np.asarray(1.0 / (1.0 + (residual / scale) ** 2))


@compiled()
def _residual(linear: Array, encoded: Array, tables: Array) -> tuple[Array, Array]:
    """Return the distances (n,) of f(linear) from the encoded values (n, 3), and the slopes df/d(linear) there (n, 3).

    tables: f⁻¹ (KNOTS, 3). Slopes are bounded, so that no dark sample outweighs all others.
    """
    rise = np.empty((KNOTS, 3))
    for knot in range(KNOTS):
        low, high = max(knot - 1, 0), min(knot + 1, KNOTS - 1)
        for c in range(3):
            rise[knot, c] = (tables[high, c] - tables[low, c]) * ((KNOTS - 1) / (high - low))
    residual, slope = np.empty(len(linear)), np.empty_like(linear)
    for n in range(len(linear)):
        total = 0.0
        for c in range(3):
            cell, fraction = _cell(encoded[n, c])
            slope[n, c] = 1.0 / max(rise[cell, c] + fraction * (rise[cell + 1, c] - rise[cell, c]), FLATTEST)
            value = linear[n, c]
            while cell > 0 and value < tables[cell, c]:  # from where the fit should have it
                cell -= 1
            while cell < KNOTS - 2 and value >= tables[cell + 1, c]:
                cell += 1
            width = tables[cell + 1, c] - tables[cell, c]
            part = (value - tables[cell, c]) / width if width > 0.0 else 1.0
            total += ((cell + min(max(part, 0.0), 1.0)) / (KNOTS - 1) - encoded[n, c]) ** 2
        residual[n] = np.sqrt(total)
    return residual, slope


@compiled()
def _cell(encoded: float) -> tuple[int, float]:
    """The knot below an encoded value, and the fraction from there to the next."""
    position = min(max(encoded, 0.0), 1.0) * (KNOTS - 1)
    cell = min(int(position), KNOTS - 2)
    return cell, position - cell


@compiled()
def _systems(
    x: Array, encoded: Array, weight: Array, slope: Array, bending: Array, towards: Array
) -> tuple[Array, Array]:
    """Return the normal equations of each channel, N (3, KNOTS + 2, KNOTS + 2) and r (3, KNOTS + 2).

    The u that minimises u'Nu − 2 r'u minimises Σ weight slope² (f⁻¹(I) − m·x)² with Σ m = 1, and what `_prior` has
    made.

    u are f⁻¹'s value at 0 and its steps, and the matrix entries of the two other channels.
    """
    normal, right = np.empty((3, KNOTS + 2, KNOTS + 2)), np.empty((3, KNOTS + 2))
    for channel in range(3):
        total, ridge = _products(x, encoded, channel, weight, slope)
        for column in range(KNOTS + 3):  # from values at the knots to steps
            for row in range(KNOTS - 2, -1, -1):
                total[row, column] += total[row + 1, column]
        for row in range(KNOTS + 3):
            for column in range(KNOTS - 2, -1, -1):
                total[row, column] += total[row, column + 1]
        for row in range(KNOTS + 2):
            for column in range(KNOTS + 2):
                normal[channel, row, column] = total[row, column] + bending[row, column]
            right[channel, row] = total[row, KNOTS + 2] + towards[row]
        for row in range(KNOTS, KNOTS + 2):
            normal[channel, row, row] += RIDGE * ridge
    return normal, right


@compiled()
def _products(x: Array, encoded: Array, channel: int, weight: Array, slope: Array) -> tuple[Array, float]:
    """Return the symmetric (KNOTS + 3, KNOTS + 3) products of weighted rows, and the sum of the weights.

    A row is [f⁻¹'s interpolation between its knots, −differences to the two other channels, what they should sum to],
    and its weight the sample's times the channel's slope².
    """
    total, sum_of_weights = np.zeros((KNOTS + 3, KNOTS + 3)), 0.0
    one, two = (channel == 0) + 0, 2 - (channel == 2)
    value = np.empty(5)
    for n in range(len(x)):
        cell, fraction = _cell(encoded[n, channel])
        own, w = x[n, channel], weight[n] * slope[n, channel] ** 2
        sum_of_weights += w
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
    for row in range(KNOTS + 3):
        for column in range(row):
            total[row, column] = total[column, row]
    return total, sum_of_weights


@compiled()
def _prior(common: Array, alike: float) -> tuple[Array, Array]:
    """N (KNOTS + 2, KNOTS + 2) and r (KNOTS + 2,) of u'Nu − 2 r'u, for u as `_systems` has it.

    common (KNOTS,): the curve whose relative changes of slope f⁻¹ takes where there are no samples, and with the weight
    alike its values; black is black, as surely as if one sample told it. A change of slope of about 3 % a knot beyond
    the common curve's counts as much as the noise of one sample.
    """
    smoothness = 3e-3
    rate = np.empty(KNOTS)
    for knot in range(KNOTS):
        low, high = max(knot - 1, 0), min(knot + 1, KNOTS - 1)
        rate[knot] = max((common[high] - common[low]) * ((KNOTS - 1) / (high - low)), FLATTEST)
    normal, right = np.zeros((KNOTS + 2, KNOTS + 2)), np.zeros(KNOTS + 2)
    for knot in range(1, KNOTS - 1):
        first, second = common[knot] - common[knot - 1], common[knot + 1] - common[knot]
        change, scale = (second - first) / max(first + second, 1e-9), (KNOTS - 1) / rate[knot]
        left, after = (-1.0 - change) * scale, (1.0 - change) * scale
        normal[knot, knot] += smoothness * left * left
        normal[knot, knot + 1] += smoothness * left * after
        normal[knot + 1, knot] += smoothness * left * after
        normal[knot + 1, knot + 1] += smoothness * after * after
    firmness = drawn = 0.0
    for knot in range(KNOTS - 1, -1, -1):  # a step is in all values that follow
        firmness += alike / rate[knot] ** 2
        drawn += alike * common[knot] / rate[knot] ** 2
        right[knot] = drawn
        for other in range(knot + 1):
            normal[knot, other] += firmness
            normal[other, knot] += firmness * (other < knot)
    normal[0, 0] += 1.0 / rate[0] ** 2
    return normal, right


@compiled()
def _matrix(x: Array, linear: Array, weight: Array, slope: Array) -> Array:
    """Ts with rows that sum to 1, that minimises Σ weight slope² (linear − Ts x)², all (n, 3) but weight (n,)."""
    rows, total = np.empty((3, 3)), weight.sum()
    for channel in range(3):
        one, two = (channel == 0) + 0, 2 - (channel == 2)
        a, b, c, d, e = RIDGE * total, 0.0, RIDGE * total, 0.0, 0.0
        for n in range(len(x)):
            w = weight[n] * slope[n, channel] ** 2
            first, second = x[n, one] - x[n, channel], x[n, two] - x[n, channel]
            wanted = linear[n, channel] - x[n, channel]
            a += w * first * first
            b += w * first * second
            c += w * second * second
            d += w * first * wanted
            e += w * second * wanted
        whole = a * c - b * b
        rows[channel, one], rows[channel, two] = (c * d - b * e) / whole, (a * e - b * d) / whole
        rows[channel, channel] = 1.0 - rows[channel, one] - rows[channel, two]
    return rows
