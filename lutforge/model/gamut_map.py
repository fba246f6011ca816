"""The gamut map h, or h⁻¹: radial basis functions φ(r) = r with a linear polynomial (thesis 4.2.3, equation 4.7)."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange
from numpy.typing import ArrayLike, NDArray

from lutforge.errors import ProfileError

Array = NDArray[np.float64]


@njit(cache=True, parallel=True, fastmath=True)
def _evaluate(x: Array, centres: Array, coefficients: Array) -> Array:
    y = np.empty((x.shape[0], 3))
    for n in prange(x.shape[0]):
        r, g, b = x[n, 0], x[n, 1], x[n, 2]
        total0, total1, total2 = 0.0, 0.0, 0.0
        for i in range(centres.shape[1]):
            dr, dg, db = r - centres[0, i], g - centres[1, i], b - centres[2, i]
            distance = np.sqrt(dr * dr + dg * dg + db * db)
            total0 += coefficients[0, i] * distance
            total1 += coefficients[1, i] * distance
            total2 += coefficients[2, i] * distance
        y[n, 0], y[n, 1], y[n, 2] = total0, total1, total2
    return y


@dataclass(frozen=True, eq=False)
class GamutMap:
    """h_c(X) = Σ_i λ_ci ‖X − X_i‖ + a_cᵀ [1, X].

    centres: X_i (n, 3), linear; coefficients: λ (n, 3); polynomial: a (4, 3), rows constant, x, y, z.
    Raises ProfileError where the shapes disagree or a number is not finite.
    """

    centres: Array
    coefficients: Array
    polynomial: Array

    def __post_init__(self) -> None:
        count = len(self.centres)
        if self.centres.shape != (count, 3) or self.coefficients.shape != (count, 3) or self.polynomial.shape != (4, 3):
            raise ProfileError("gamut map: expected n centres, n coefficients and 4 polynomial rows of 3 numbers")
        for part in (self.centres, self.coefficients, self.polynomial):
            if not np.all(np.isfinite(part)):
                raise ProfileError("gamut map: a number is not finite")

    def __call__(self, x: ArrayLike) -> Array:
        """h at x (…, 3). Time O(points · centres), multi-threaded, no matrix of distances is formed."""
        points = np.asarray(x, dtype=np.float64)
        flat = np.ascontiguousarray(points.reshape(-1, 3))
        radial: Array = _evaluate(flat, np.ascontiguousarray(self.centres.T), np.ascontiguousarray(self.coefficients.T))
        mapped: Array = radial + self.polynomial[0] + flat @ self.polynomial[1:]
        return mapped.reshape(points.shape)
