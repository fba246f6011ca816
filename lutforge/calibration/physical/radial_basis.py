"""Radial basis functions with few centres, fitted to many samples by penalized least squares (not through the centres).

min Σ w ‖Σ λ_i φ(‖z − z_i‖) + a·[1, z] − t‖² + μ λ'Φλ,  Σ λ_i [1, z_i] = 0.   Φ is positive there, as φ(r) = r³ is
conditionally positive definite of order 2 (Duchon 1977). The kink of φ(r) = r at every centre, which (4.7) of the
thesis has, costs accuracy between samples, and its slope beyond the outermost ones is theirs alone; r³ has neither.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dgeqrf, dposv

from lutforge.arrays import Array, Index, Mask
from lutforge.compiled import REASSOCIATED, compiled
from lutforge.threads import run, slabs

SMOOTHNESS = 3e-4
"""μ, per sample of weight 1: so little that noise is averaged by how few the centres are, enough for centres that no
sample is near."""


@dataclass(frozen=True, eq=False)
class RadialBasis:
    """Σ_i λ_i ‖z − z_i‖³ + a·[1, z]. centres: z_i (m, 3); coefficients: λ (m, 3); polynomial: a (4, 3)."""

    centres: Array
    coefficients: Array
    polynomial: Array

    def __call__(self, z: Array) -> Array:
        """Values at z (…, 3). Time O(points · centres)."""
        points = np.ascontiguousarray(z.reshape(-1, 3))
        values = np.empty_like(points)

        def evaluate(first: int, last: int) -> None:
            _evaluate(points[first:last], self.centres, self.coefficients, self.polynomial, values[first:last])

        # in two parts where they are many
        run(evaluate, slabs(0, len(points), 1, 2 if len(points) * len(self.centres) > 1_000_000 else 1))
        return values.reshape(z.shape)


class RadialBasisProblem:
    """The least-squares problem of radial basis functions at samples source (n, 3), with their centres (m, 3).

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
        self.bending[4:, 4:] = inner[4:, 4:]

    def equations(self, target: Array, weight: Array, rows: Mask | None = None) -> Array:
        """The normal matrix of some rows and beside it their right sides, (m, m + 3), without the bending term."""
        chosen = np.arange(len(target)) if rows is None else np.flatnonzero(rows)
        root = np.sqrt(weight)
        parts: dict[int, Array] = {}
        count, unknowns = len(chosen), self.design.shape[1]

        def add(first: int, last: int) -> None:
            weighted = _weighted(self.design, target, root, chosen[first:last])
            parts[first] = (weighted.T @ weighted)[:-3]

        # Normal equations of more products than this are summed in two parts, at once where there are two cores
        run(add, slabs(0, count, 1, 2 if count * unknowns**2 > 10_000_000 else 1))
        return np.asarray(np.sum([parts[first] for first in sorted(parts)], axis=0))

    def fit(self, target: Array, weight: Array) -> tuple[RadialBasis, Array]:
        """The functions for targets (n, 3) of weights (n,), and their residuals (n, 3).

        Raises LinAlgError where the equations are singular.
        """
        functions, unknowns = self.solve(self.equations(target, weight))
        return functions, self.design @ unknowns - target

    def solve(self, equations: Array) -> tuple[RadialBasis, Array]:
        """The functions, and the unknowns (4 + …, 3). Raises LinAlgError where the equations are singular."""
        _, unknowns, singular = dposv(equations[:, :-3] + SMOOTHNESS * self.bending, equations[:, -3:])
        if singular or not np.all(np.isfinite(unknowns)):
            raise LinAlgError("the equations of the radial basis functions are singular")
        padded = unknowns.copy()
        padded[:4] = 0.0
        coefficients = padded - self._v.T @ (self._t @ (self._v @ padded))
        return RadialBasis(self.centres, coefficients, unknowns[:4].copy()), unknowns


def _reflectors(matrix: Array) -> tuple[Array, Array]:
    """V (k, m) and T (k, k) of the QR factorization of a matrix (m, k), Q = I − V'T V (LAPACK's dlarft)."""
    reflectors, tau, _, _ = dgeqrf(matrix)
    count = len(tau)
    v = np.ascontiguousarray((np.tril(reflectors, -1) + np.eye(*reflectors.shape)).T)
    t = np.zeros((count, count))
    for k in range(count):
        t[:k, k] = -tau[k] * (t[:k, :k] @ (v[:k] @ v[k]))
        t[k, k] = tau[k]
    return v, t


@compiled(fastmath=REASSOCIATED)
def _projected(source: Array, centres: Array, v: Array, t: Array) -> Array:
    """‖source − centre‖³ of all pairs, times Q, (n, m); source: (n, 3), centres: (3, m)."""
    count, kept = centres.shape[1], len(v)
    result, sums, share = np.empty((len(source), count)), np.empty(kept), np.empty(kept)
    for n in range(len(source)):
        row = result[n]
        r, g, b = source[n, 0], source[n, 1], source[n, 2]
        for i in range(count):
            square = (centres[0, i] - r) ** 2 + (centres[1, i] - g) ** 2 + (centres[2, i] - b) ** 2
            row[i] = square * np.sqrt(square)
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


@compiled(fastmath=REASSOCIATED)
def _evaluate(z: Array, centres: Array, coefficients: Array, polynomial: Array, values: Array) -> None:
    """Fills values (n, 3) at z (n, 3)."""
    count = len(centres)
    x, y, w = centres[:, 0].copy(), centres[:, 1].copy(), centres[:, 2].copy()
    u, v, t = coefficients[:, 0].copy(), coefficients[:, 1].copy(), coefficients[:, 2].copy()
    for n in range(len(z)):
        r, g, b = z[n]
        first, second, third = 0.0, 0.0, 0.0
        for i in range(count):
            square = (x[i] - r) ** 2 + (y[i] - g) ** 2 + (w[i] - b) ** 2
            cube = square * np.sqrt(square)
            first += u[i] * cube
            second += v[i] * cube
            third += t[i] * cube
        p = polynomial
        values[n, 0] = first + p[0, 0] + p[1, 0] * r + p[2, 0] * g + p[3, 0] * b
        values[n, 1] = second + p[0, 1] + p[1, 1] * r + p[2, 1] * g + p[3, 1] * b
        values[n, 2] = third + p[0, 2] + p[1, 2] * r + p[2, 2] * g + p[3, 2] * b


@compiled()
def _weighted(design: Array, target: Array, root: Array, rows: Index) -> Array:
    """The chosen rows of [design, target] times their weights' roots."""
    unknowns = design.shape[1]
    result = np.empty((len(rows), unknowns + 3))
    for place, n in enumerate(rows):
        for i in range(unknowns):
            result[place, i] = root[n] * design[n, i]
        for c in range(3):
            result[place, unknowns + c] = root[n] * target[n, c]
    return result


@compiled(fastmath={"contract"})
def spread(points: Array, count: int) -> Index:
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
