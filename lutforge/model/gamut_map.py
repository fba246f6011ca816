"""The gamut map h, or h⁻¹: radial basis functions with a linear polynomial (thesis 4.2.3, equation 4.7).

On linear values, as the thesis has it, or on an even scale, on which dark colours lie as far apart as they look:
e(x) = ±((|x| + ε)^(1/2.4) − ε^(1/2.4)) / c with c such that e(1) = 1. Colours and what is added to them have each an ε
of their own.

The thesis's function is φ(r) = r. The other one is the covariance of kriging (`calibration.gamut_map`), a sum of
three that fade (Rasmussen & Williams, Gaussian Processes for Machine Learning, 2006, section 4.2.1), with t = r/ℓ:
φ(r) = ρ exp(−t) + 0.8 (1 + 8t) exp(−8t) + 3 exp(−3 t²). The first is rough and reaches far; its limit for long ℓ is
φ(r) = r, and its weight ρ, the roughness, is the camera's own. The second is smooth and reaches an eighth as far. The
third is what a polynomial trend would be, and goes on smoothly beyond the samples. Distances along the grey axis count
one half.
"""

from dataclasses import dataclass
from functools import cached_property
from math import factorial
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array, Single
from lutforge.compiled import compiled
from lutforge.errors import ProfileError
from lutforge.threads import run, shares

BLOCK = 64
"""Centres per block of the evaluation."""
POWER = 1 / 2.4
OFFSET = 0.02
"""ε of the perceptual scale of colours, for kriging."""
CORRECTION_OFFSET = 0.03
"""ε of the perceptual scale of corrections, for kriging.

It is larger than that of colours, so that a correction of colours whose least channel is near 0 or below, as of strong
yellows, is no larger than it looks. A larger one is as good on colours, but channels of the Canon S40 then fall by more
codes as light rises.
"""

Kernel = Literal["linear", "kriging"]
KERNELS: tuple[Kernel, ...] = get_args(Kernel)
REACH = 4.8
"""ℓ of the kriging kernel, on the even scale."""
WIDE = 3.0 / REACH**2
"""The third part of the kernel is 3 exp(−WIDE r²)."""
DEGREE = 8
"""The degree of the polynomial that stands for the sum of the third part over all centres.

It is within 1e-9 of that sum for colours up to twice as far from the middle as the centres are.
"""
ONE, TWO, SMOOTH, SLOPE = (np.float32(number) for number in (1.0, 2.0, 0.8, 6.4))
HALF, THIRD, QUARTER, FIFTH, SIXTEENTH = (np.float32(1.0 / number) for number in (2, 3, 4, 5, 16))
INVERSE_REACH, LARGEST = np.float32(1.0 / REACH), np.float32(0.35)
"""The numbers of `_kriging` and `_falling` in float32: one in float64 would make all that it meets float64."""
ROUGHNESS = 0.2
"""ρ of a kriging kernel whose process is not known."""
ALONG_GREY = 0.5
"""How much a distance along the grey axis counts: exposure changes what a gamut map does less than hue and chroma."""


def to_even(linear: ArrayLike, offset: float) -> Array:
    """e(x) of linear values of any shape; an offset ε of 0 leaves them as they are."""
    x = np.asarray(linear, dtype=np.float64)
    low = offset**POWER
    even = np.sign(x) * ((np.abs(x) + offset) ** POWER - low) / ((1.0 + offset) ** POWER - low)
    return np.asarray(even if offset else x)


def from_even(even: ArrayLike, offset: float) -> Array:
    """e⁻¹(y), exact."""
    y = np.asarray(even, dtype=np.float64)
    low = offset**POWER
    linear = np.sign(y) * ((np.abs(y) * ((1.0 + offset) ** POWER - low) + low) ** (1 / POWER) - offset)
    return np.asarray(linear if offset else y)


@compiled(fastmath=True)
def _evaluate(
    x: Array,
    polynomial: Array,
    middles: Array,
    totals: Array,
    centres: Single,
    coefficients: Single,
    y: Array,
    first: int,
    last: int,
) -> None:
    """y = a·[1, x] + Σ λ ‖x − c‖, block by block.

    With q the distance to the block's middle, Σ λ (‖x − c‖ − q) is a small sum, good in float32 (16 at a time), and
    q Σ λ is added in float64: within 1.2e-6 of the exact sum where Σ|λ| = 230.
    """
    for n in range(first, last):
        x0, x1, x2 = x[n, 0], x[n, 1], x[n, 2]
        p = polynomial
        total0 = p[0, 0] + p[1, 0] * x0 + p[2, 0] * x1 + p[3, 0] * x2
        total1 = p[0, 1] + p[1, 1] * x0 + p[2, 1] * x1 + p[3, 1] * x2
        total2 = p[0, 2] + p[1, 2] * x0 + p[2, 2] * x1 + p[3, 2] * x2
        for block in range(centres.shape[0]):
            r, g, b = x0 - middles[block, 0], x1 - middles[block, 1], x2 - middles[block, 2]
            q = np.float32(np.sqrt(r * r + g * g + b * b))
            fr, fg, fb = np.float32(r), np.float32(g), np.float32(b)
            sum0, sum1, sum2 = np.float32(0), np.float32(0), np.float32(0)
            for i in range(BLOCK):
                dr, dg, db = fr - centres[block, 0, i], fg - centres[block, 1, i], fb - centres[block, 2, i]
                distance = np.sqrt(dr * dr + dg * dg + db * db) - q
                sum0 += coefficients[block, 0, i] * distance
                sum1 += coefficients[block, 1, i] * distance
                sum2 += coefficients[block, 2, i] * distance
            far = np.float64(q)
            total0 += sum0 + totals[block, 0] * far
            total1 += sum1 + totals[block, 1] * far
            total2 += sum2 + totals[block, 2] * far
        y[n, 0], y[n, 1], y[n, 2] = total0, total1, total2


@compiled(fastmath=True)
def _falling(x: float) -> float:
    """exp(−x), as the 16th power of a polynomial, which a compiler can vectorize; constant beyond x = 5.6."""
    t = min(x / 16.0, 0.35)
    root: float = 1.0 - t * (1.0 - t / 2.0 * (1.0 - t / 3.0 * (1.0 - t / 4.0 * (1.0 - t / 5.0 * (1.0 - t / 6.0)))))
    for _ in range(4):
        root *= root
    return root


@compiled(fastmath=True)
def _kriging(square: float, roughness: float) -> float:
    """φ of a squared distance, in the kernel of kriging."""
    part = square / (REACH * REACH)
    ratio = np.sqrt(part)
    far = _falling(ratio)
    near = far * far
    near *= near
    near *= near
    value: float = roughness * far + 0.8 * (1.0 + 8.0 * ratio) * near + 3.0 * _falling(3.0 * part)
    return value


@compiled(fastmath=True)
def _evaluate_kriging(
    x: Array,
    flat: Array,
    polynomial: Array,
    middle: Array,
    moments: Array,
    middles: Array,
    centres: Single,
    coefficients: Single,
    rough: np.float32,
    y: Array,
    first: int,
    last: int,
) -> None:
    """y = a·[1, x] + Σ λ φ(‖flat − c‖): the first two parts of φ block by block in float32, the third as a polynomial.

    exp(−t) − 1 is squared as (1 + m)² − 1 = m (2 + m), so that rounding is not squared with it: within 3e-5 of the
    exact sum, 6e-6 in the mean, where Σ|λ| = 2,000.
    """
    one, two, smooth, slope = ONE, TWO, SMOOTH, SLOPE
    for n in range(first, last):
        x0, x1, x2 = x[n, 0], x[n, 1], x[n, 2]
        p = polynomial
        total0 = p[0, 0] + p[1, 0] * x0 + p[2, 0] * x1 + p[3, 0] * x2
        total1 = p[0, 1] + p[1, 1] * x0 + p[2, 1] * x1 + p[3, 1] * x2
        total2 = p[0, 2] + p[1, 2] * x0 + p[2, 2] * x1 + p[3, 2] * x2
        x0, x1, x2 = flat[n, 0] - middle[0], flat[n, 1] - middle[1], flat[n, 2] - middle[2]
        row, power0 = 0, np.exp(-WIDE * (x0 * x0 + x1 * x1 + x2 * x2))
        for i in range(DEGREE + 1):
            power1 = power0
            for j in range(DEGREE + 1 - i):
                power2 = power1
                for _ in range(DEGREE + 1 - i - j):
                    total0 += power2 * moments[row, 0]
                    total1 += power2 * moments[row, 1]
                    total2 += power2 * moments[row, 2]
                    power2 *= x2
                    row += 1
                power1 *= x1
            power0 *= x0
        for block in range(centres.shape[0]):
            fr = np.float32(flat[n, 0] - middles[block, 0])
            fg = np.float32(flat[n, 1] - middles[block, 1])
            fb = np.float32(flat[n, 2] - middles[block, 2])
            sum0, sum1, sum2 = np.float32(0), np.float32(0), np.float32(0)
            for i in range(BLOCK):
                dr, dg, db = fr - centres[block, 0, i], fg - centres[block, 1, i], fb - centres[block, 2, i]
                ratio = np.sqrt(dr * dr + dg * dg + db * db) * INVERSE_REACH
                t = min(ratio * SIXTEENTH, LARGEST)
                far = -t * (one - t * HALF * (one - t * THIRD * (one - t * QUARTER * (one - t * FIFTH))))
                far *= two + far
                far *= two + far
                far *= two + far
                far *= two + far
                near = far * (two + far)
                near *= two + near
                near *= two + near
                value = rough * (one + far) + (smooth + slope * ratio) * (one + near)
                sum0 += coefficients[block, 0, i] * value
                sum1 += coefficients[block, 1, i] * value
                sum2 += coefficients[block, 2, i] * value
            total0 += sum0
            total1 += sum1
            total2 += sum2
        y[n, 0], y[n, 1], y[n, 2] = total0, total1, total2


@compiled(fastmath=True)
def _covariance(
    points: Array, others: Array, roughness: float, triangle: bool, covariance: Array, first: int, last: int
) -> None:
    """Fill rows of φ between points (3, n) and others (3, m), or of its lower triangle only."""
    for n in range(first, last):
        row, f0, f1, f2 = covariance[n], points[0, n], points[1, n], points[2, n]
        for i in range(n + 1 if triangle else others.shape[1]):
            square = (f0 - others[0, i]) ** 2 + (f1 - others[1, i]) ** 2 + (f2 - others[2, i]) ** 2
            row[i] = _kriging(square, roughness)


def kriging_covariance(even: Array, others: Array | None = None, roughness: float = ROUGHNESS) -> Array:
    """The kriging kernel between points (n, 3) of the even scale and others (m, 3), (n, m).

    Between the points themselves, without others, its lower triangle; 0 above.
    """
    points = np.ascontiguousarray(flattened(even).T)
    columns = points if others is None else np.ascontiguousarray(flattened(others).T)
    covariance = np.zeros((points.shape[1], columns.shape[1]))
    run(
        lambda first, last: _covariance(points, columns, roughness, others is None, covariance, first, last),
        shares(len(even), 200),
    )
    return covariance


def flattened(even: Array) -> Array:
    """Points (n, 3) of the even scale with their brightness scaled by ALONG_GREY, as the kriging kernel takes them."""
    return np.asarray(even - (1.0 - ALONG_GREY) * even.mean(axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class GamutMap:
    """h_c(X) = Σ_i λ_ci φ(‖X − X_i‖) + a_cᵀ [1, X], or on even scales: h(X) = ê⁻¹(Σ_i λ_i φ(‖e(X) − e(X_i)‖) + …).

    centres: X_i (n, 3), linear; coefficients: λ (n, 3); polynomial: a (4, 3), rows constant, x, y, z; offset: ε of the
    even scale e, 0 for none; kernel: the function φ of the distance; roughness: ρ of kriging's; correction_offset: ε of
    ê, which is e for the linear kernel. Raises ProfileError where the shapes disagree, a number is not finite or the
    kernel is unknown.
    """

    centres: Array
    coefficients: Array
    polynomial: Array
    offset: float = 0.0
    kernel: Kernel = "linear"
    roughness: float = ROUGHNESS
    correction_offset: float = 0.0

    def __post_init__(self) -> None:
        count = len(self.centres)
        if self.centres.shape != (count, 3) or self.coefficients.shape != (count, 3) or self.polynomial.shape != (4, 3):
            raise ProfileError("gamut map: expected n centres, n coefficients and 4 polynomial rows of 3 numbers")
        for part in (self.centres, self.coefficients, self.polynomial):
            if not np.all(np.isfinite(part)):
                raise ProfileError("gamut map: a number is not finite")
        for offset in (self.offset, self.correction_offset):
            if not 0.0 <= offset <= 1.0:
                raise ProfileError(f"gamut map: the offset of its scale, {offset}, is not within 0 … 1")
        if self.kernel not in KERNELS:
            raise ProfileError(f"gamut map: unknown kernel {self.kernel!r}")
        if self.kernel == "linear" and self.offset != self.correction_offset:
            raise ProfileError("gamut map: a linear kernel has one scale, not two")
        if not 0.0 <= self.roughness <= 1e3:
            raise ProfileError(f"gamut map: its roughness, {self.roughness}, is not within 0 … 1000")

    @property
    def is_identity(self) -> bool:
        """True where it changes nothing."""
        return not self.coefficients.any() and np.array_equal(self.polynomial, identity_gamut_map().polynomial)

    def __call__(self, x: ArrayLike) -> Array:
        """h at x (…, 3). Time O(points · centres), multi-threaded, no matrix of distances is formed."""
        points = np.asarray(x, dtype=np.float64)
        flat = np.ascontiguousarray(to_even(points.reshape(-1, 3), self.offset))
        uncorrected = np.ascontiguousarray(to_even(points.reshape(-1, 3), self.correction_offset))
        polynomial, mapped = np.ascontiguousarray(self.polynomial), np.empty_like(flat)

        def evaluate(first: int, last: int) -> None:
            if self.kernel == "linear":
                _evaluate(flat, polynomial, *self._blocks, mapped, first, last)
            else:
                middles, _, centres, factors = self._blocks
                middle, moments = self._moments
                _evaluate_kriging(
                    uncorrected,
                    flattened(flat),
                    polynomial,
                    middle,
                    moments,
                    middles,
                    centres,
                    factors,
                    np.float32(self.roughness),
                    mapped,
                    first,
                    last,
                )

        run(evaluate, shares(len(flat), 2_000))  # points that are worth a thread
        return from_even(mapped, self.correction_offset).reshape(points.shape)

    @cached_property
    def _points(self) -> Array:
        """The centres (n, 3) as the kernel takes them."""
        points = to_even(self.centres, self.offset)
        return points if self.kernel == "linear" else flattened(points)

    @cached_property
    def _moments(self) -> tuple[Array, Array]:
        """The mean c̄ of the centres (3,), and the polynomial for the third part of the kernel, (terms, 3).

        With u = c − c̄ and v = x − c̄, exp(−w ‖v − u‖²) = exp(−w v²) exp(−w u²) Σ (2w)^|α| u^α v^α / α!. The exponents α
        are in the order of the loops of `_evaluate_kriging`.
        """
        middle = self._points.mean(axis=0)
        offsets = self._points - middle
        weights = 3.0 * self.coefficients * np.exp(-WIDE * np.sum(offsets**2, axis=1))[:, None]
        powers = np.cumprod(np.vstack([np.ones((1, *offsets.shape)), np.tile(offsets, (DEGREE, 1, 1))]), axis=0)
        scale = np.array([(2.0 * WIDE) ** order / factorial(order) for order in range(DEGREE + 1)])
        powers *= scale[:, None, None]
        order = range(DEGREE + 1)
        terms = [(i, j, k) for i in order for j in order[: DEGREE + 1 - i] for k in order[: DEGREE + 1 - i - j]]
        moments = [(powers[i, :, 0] * powers[j, :, 1] * powers[k, :, 2]) @ weights for i, j, k in terms]
        return middle, np.array(moments)

    @cached_property
    def _blocks(self) -> tuple[Array, Array, Single, Single]:
        """What `_evaluate` takes: per block its middle, Σ λ, centres from the middle and λ (3, BLOCK)."""
        points = self._points
        order = np.zeros(0, dtype=np.intp)
        if len(points):  # neighbours near each other: Morton's order, of the interleaved bits of the coordinates
            span = np.maximum(np.ptp(points, axis=0), 1e-30)
            cells = ((points - points.min(axis=0)) / span * 1023).astype(np.int64)
            code = np.zeros(len(points), dtype=np.int64)
            for bit in range(10):
                for axis in range(3):
                    code |= ((cells[:, axis] >> bit) & 1) << (3 * bit + axis)
            order = np.argsort(code, kind="stable")
        missing = -len(order) % BLOCK
        centres = np.pad(points[order], ((0, missing), (0, 0)), mode="edge" if len(order) else "constant")
        coefficients = np.pad(self.coefficients[order], ((0, missing), (0, 0))).reshape(-1, BLOCK, 3)
        centres = centres.reshape(-1, BLOCK, 3)
        middles = centres.mean(axis=1)
        near = np.ascontiguousarray((centres - middles[:, None]).transpose(0, 2, 1), dtype=np.float32)
        factors = np.ascontiguousarray(coefficients.transpose(0, 2, 1), dtype=np.float32)
        return middles, factors.sum(axis=2, dtype=np.float64), near, factors


def identity_gamut_map() -> GamutMap:
    """h(p) = p: the conventional model, f and T without h."""
    return GamutMap(np.zeros((1, 3)), np.zeros((1, 3)), np.vstack([np.zeros((1, 3)), np.eye(3)]))
