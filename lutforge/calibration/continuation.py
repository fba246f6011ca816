"""What a lattice continues where it has no samples: matrix, response, and a smooth gamut map between them.

render: f(h(Ts x)), linearize: Ts⁻¹ h⁻¹(f⁻¹(I)). The gamut map is (4.7) with few centres spread over the samples, fitted
to all of them by least squares (not through the centres), so that noise and a stray sample do not bend it:

min Σ w ‖Σ λ_i φ(‖X − X_i‖) + a·[1, X] − X'‖² − μ λ'Φλ,  Σ λ_i [1, X_i] = 0.   −Φ is positive there, as φ(r) = r is
conditionally negative definite. Weights make the error count in encoded values, and less where it is large (Cauchy).
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, solve
from scipy.spatial.distance import cdist

from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.errors import ProfileError
from lutforge.model.gamut_map import GamutMap
from lutforge.regression.blas import one_blas_thread

Array = NDArray[np.float64]

CENTRES = 200
MOST_SAMPLES = 3_000
FEWEST_COLOURS = 30
"""Fewer distinct ones do not bend a gamut map: matrix and response alone are continued."""
SMOOTHNESS = 1e-2
"""μ, per sample of weight 1."""
ROUNDS = 3
LEAST_SCALE = 4.0 / 255.0
LEAST_SPREAD = 1e-3
"""Samples whose smallest principal deviation is below this lie in a plane, and tell no gamut map."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """A guess of one direction: inverse is linearize, else render; gamut_map: h or h⁻¹, None where it is not known."""

    base: MatrixAndResponse
    inverse: bool
    gamut_map: GamutMap | None = None

    def __call__(self, x: Array) -> Array:
        """The guess at x (…, 3)."""
        mapped = self.mapped(x)
        if self.inverse:
            return mapped @ np.linalg.inv(self.base.matrix).T
        return self.base.response.encode(mapped)

    def mapped(self, x: Array) -> Array:
        """Linear light of the guess at x (…, 3), after the gamut map; not clipped."""
        linear = self._enter(x)
        return linear if self.gamut_map is None else self.gamut_map(linear)

    def refit(self, x: Array, y: Array) -> "Continuation":
        """The guess that samples x → y (n, 3) of its direction make, with the same matrix and response."""
        rows = np.random.default_rng(0).permutation(len(x))[:MOST_SAMPLES]
        x, y = x[rows], y[rows]
        source = self._enter(x)
        spread = np.linalg.svd(source - source.mean(axis=0), compute_uv=False)[-1] if len(source) else 0.0
        distinct = len(np.unique(np.round(source, 3), axis=0))
        if distinct < FEWEST_COLOURS or spread < LEAST_SPREAD * len(source) ** 0.5:
            return replace(self, gamut_map=None)
        target = y @ self.base.matrix.T if self.inverse else self.base.response.linearize(y)
        slope = np.ones(len(source)) if self.inverse else _encoding_slope(self.base, y)
        try:
            return replace(self, gamut_map=_fit(source, target, slope))
        except (LinAlgError, ProfileError):  # colours that coincide
            return replace(self, gamut_map=None)

    def _enter(self, x: Array) -> Array:
        return self.base.response.linearize(x) if self.inverse else x @ self.base.matrix.T


@one_blas_thread
def continuation(base: MatrixAndResponse, x: Array, y: Array, *, inverse: bool) -> Continuation:
    """Fit the gamut map of one direction to samples x → y (n, 3), given matrix and response."""
    return Continuation(base, inverse).refit(x, y)


def _encoding_slope(base: MatrixAndResponse, encoded: Array) -> Array:
    """df/d(linear) at encoded values (n, 3), the mean of the channels, bounded as in the fit of matrix and response."""
    step = 1.0 / 255.0
    low, high = base.response.linearize(encoded - step), base.response.linearize(encoded + step)
    slope: Array = np.mean(1.0 / np.maximum((high - low) / (2 * step), 0.05), axis=1)
    return slope


def _fit(source: Array, target: Array, slope: Array) -> GamutMap:
    """h: source → target (n, 3), both linear; slope (n,) turns a residual into the units it is judged in."""
    centres = source[_spread(source, min(CENTRES, len(source) // 2))]
    # The space of λ that the polynomial leaves: orthogonal to 1 and the coordinates of the centres.
    free = np.linalg.qr(np.column_stack([np.ones(len(centres)), centres]), mode="complete")[0][:, 4:]
    polynomial = np.column_stack([np.ones(len(source)), source])
    design = np.column_stack([cdist(source, centres) @ free, polynomial])
    bending = np.zeros((design.shape[1], design.shape[1]))
    bending[: free.shape[1], : free.shape[1]] = -free.T @ cdist(centres, centres) @ free
    weight = (slope / np.median(slope)) ** 2
    robust = np.ones(len(source))
    for _ in range(ROUNDS):
        weighted = design * (weight * robust)[:, None]
        unknowns = solve(design.T @ weighted + SMOOTHNESS * bending, weighted.T @ target, assume_a="pos")
        residual = np.linalg.norm(design @ unknowns - target, axis=1) * slope
        scale = max(4.0 * float(np.median(residual)), LEAST_SCALE)
        robust = 1.0 / (1.0 + (residual / scale) ** 2)
    return GamutMap(centres, free @ unknowns[: free.shape[1]], unknowns[free.shape[1] :])


def _spread(points: Array, count: int) -> NDArray[np.intp]:
    """Farthest-point sampling: each next point is the one farthest from those chosen."""
    squares = np.einsum("nc,nc->n", points, points)
    chosen = [int(np.argmin(squares))]
    distance = np.full(len(points), np.inf)
    while len(chosen) < count:
        last = chosen[-1]
        distance = np.minimum(distance, squares - 2.0 * (points @ points[last]) + squares[last])
        chosen.append(int(np.argmax(distance)))
    return np.array(chosen)
