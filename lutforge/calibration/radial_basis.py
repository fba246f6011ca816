"""A gamut map h with few centres, fitted to many samples by penalised least squares (not through the centres).

min Σ w ‖Σ λ_i φ(‖X − X_i‖) + a·[1, X] − X'‖² − μ λ'Φλ,  Σ λ_i [1, X_i] = 0.   −Φ is positive there, as φ(r) = r is
conditionally negative definite. (4.7) of the thesis is the same without w and μ, through every sample.
"""

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dgeqrf, dposv, dpotrs

from lutforge.model.gamut_map import GamutMap
from lutforge.regression.stencil import REASSOCIATED
from lutforge.threads import run, slabs

Array = NDArray[np.float64]

SMOOTHNESS = 1e-2
"""μ, per sample of weight 1."""
PRODUCTS_PER_PART = 10_000_000
"""Normal equations of more products than this are summed in two parts, at once where there are two cores."""


@dataclass(frozen=True, eq=False)
class RadialBasisFit:
    """h, its residuals (n, 3), and what it was fitted with: its normal matrix's Cholesky factor, and weights (n,)."""

    gamut_map: GamutMap
    residual: Array
    factor: Array
    weight: Array


class RadialBasisProblem:
    """The least-squares problem of h at samples source (n, 3), with its centres (m, 3).

    Unknowns are the four of the polynomial, then λ in the space that it leaves: orthogonal to 1 and the coordinates of
    the centres, whose basis Q is kept as I − V T V', the Householder reflectors that span it. Time O(n m²).
    """

    def __init__(self, source: Array, centres: Array) -> None:
        self.centres = centres
        self._v, self._t = _reflectors(np.column_stack([np.ones(len(centres)), centres]))
        self.design = _projected(source, np.ascontiguousarray(centres.T), self._v, self._t)
        self.design[:, 0], self.design[:, 1:4] = 1.0, source
        inner = _projected(centres, np.ascontiguousarray(centres.T), self._v, self._t)
        inner -= self._v.T @ (self._t.T @ (self._v @ inner))
        self.bending = np.zeros_like(inner)
        self.bending[4:, 4:] = -inner[4:, 4:]

    def equations(self, target: Array, weight: Array, rows: NDArray[np.bool_] | None = None) -> Array:
        """The normal matrix of some rows and beside it their right sides, (m, m + 3), without the bending term."""
        chosen = np.arange(len(target)) if rows is None else np.flatnonzero(rows)
        root = np.sqrt(weight)
        parts: dict[int, Array] = {}
        count, unknowns = len(chosen), self.design.shape[1]

        def add(first: int, last: int) -> None:
            weighted = _weighted(self.design, target, root, chosen[first:last])
            parts[first] = (weighted.T @ weighted)[:-3]

        run(add, slabs(0, count, 1, 2 if count * unknowns**2 > PRODUCTS_PER_PART else 1))
        return np.asarray(np.sum([parts[first] for first in sorted(parts)], axis=0))

    def fit(self, target: Array, weight: Array) -> RadialBasisFit:
        """h to targets (n, 3) of weights (n,). Raises LinAlgError where the equations are singular."""
        gamut_map, unknowns, factor = self.solve(self.equations(target, weight))
        return RadialBasisFit(gamut_map, self.design @ unknowns - target, factor, weight)

    def like(self, fit: RadialBasisFit, target: Array) -> Array:
        """The residual (n, 3) of a fit to another target with the normal matrix and the weights of this one: near
        enough to tell whether that target can be better."""
        right = self.design.T @ (fit.weight[:, None] * target)
        return np.asarray(self.design @ dpotrs(fit.factor, right)[0] - target)

    def solve(self, equations: Array) -> tuple[GamutMap, Array, Array]:
        """h, the unknowns (4 + …, 3), and the Cholesky factor of the normal matrix.

        Raises LinAlgError where the equations are singular.
        """
        factor, unknowns, singular = dposv(equations[:, :-3] + SMOOTHNESS * self.bending, equations[:, -3:])
        if singular:
            raise LinAlgError("the equations of the gamut map are singular")
        padded = unknowns.copy()
        padded[:4] = 0.0
        coefficients = padded - self._v.T @ (self._t @ (self._v @ padded))
        return GamutMap(self.centres, coefficients, unknowns[:4].copy()), unknowns, factor


def _reflectors(matrix: Array) -> tuple[Array, Array]:
    """V (k, m) and T (k, k) of the QR factorisation of a matrix (m, k), Q = I − V'T V (LAPACK's dlarft)."""
    reflectors, tau, _, _ = dgeqrf(matrix)
    count = len(tau)
    v = np.ascontiguousarray((np.tril(reflectors, -1) + np.eye(*reflectors.shape)).T)
    t = np.zeros((count, count))
    for k in range(count):
        t[:k, k] = -tau[k] * (t[:k, :k] @ (v[:k] @ v[k]))
        t[k, k] = tau[k]
    return v, t


@njit(cache=True, nogil=True, fastmath=REASSOCIATED)
def _projected(source: Array, centres: Array, v: Array, t: Array) -> Array:
    """‖source − centre‖ of all pairs, times Q, (n, m); source: (n, 3), centres: (3, m)."""
    count, kept = centres.shape[1], len(v)
    result, sums, share = np.empty((len(source), count)), np.empty(kept), np.empty(kept)
    for n in range(len(source)):
        row = result[n]
        r, g, b = source[n, 0], source[n, 1], source[n, 2]
        for i in range(count):
            row[i] = np.sqrt((centres[0, i] - r) ** 2 + (centres[1, i] - g) ** 2 + (centres[2, i] - b) ** 2)
        for k in range(kept):
            total = 0.0
            for i in range(count):
                total += row[i] * v[k, i]
            sums[k] = total
        for k in range(kept):
            share[k] = 0.0
            for other in range(k + 1):
                share[k] += sums[other] * t[other, k]
        for k in range(kept):
            for i in range(count):
                row[i] -= share[k] * v[k, i]
    return result


@njit(cache=True, nogil=True)
def _weighted(design: Array, target: Array, root: Array, rows: NDArray[np.int64]) -> Array:
    """The chosen rows of [design, target] times their weights' roots."""
    unknowns = design.shape[1]
    result = np.empty((len(rows), unknowns + 3))
    for place, n in enumerate(rows):
        for i in range(unknowns):
            result[place, i] = root[n] * design[n, i]
        for c in range(3):
            result[place, unknowns + c] = root[n] * target[n, c]
    return result


@njit(cache=True, nogil=True, fastmath={"contract"})
def spread(points: Array, count: int) -> NDArray[np.int64]:
    """Farthest-point sampling: each next point is the one farthest from those chosen. The first is nearest to black."""
    chosen, distance = np.empty(count, dtype=np.int64), np.empty(len(points))
    darkest = np.inf
    for n in range(len(points)):
        distance[n] = np.inf
        square = points[n, 0] ** 2 + points[n, 1] ** 2 + points[n, 2] ** 2
        if square < darkest:
            darkest, chosen[0] = square, n
    for place in range(1, count):
        r, g, b = points[chosen[place - 1], 0], points[chosen[place - 1], 1], points[chosen[place - 1], 2]
        farthest, at = -1.0, 0
        for n in range(len(points)):
            square = (points[n, 0] - r) ** 2 + (points[n, 1] - g) ** 2 + (points[n, 2] - b) ** 2
            distance[n] = min(distance[n], square)
            if distance[n] > farthest:
                farthest, at = distance[n], n
        chosen[place] = at
    return chosen
