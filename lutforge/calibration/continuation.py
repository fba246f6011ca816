"""What a lattice continues where it has no samples: matrix, response, and a smooth gamut map between them.

render: f(h(Ts x)), linearize: Ts⁻¹ h⁻¹(f⁻¹(I)). The gamut map is (4.7) with few centres spread over the samples, fitted
to all of them by least squares (not through the centres), so that noise and a stray sample do not bend it:

min Σ w ‖Σ λ_i φ(‖X − X_i‖) + a·[1, X] − X'‖² − μ λ'Φλ,  Σ λ_i [1, X_i] = 0.   −Φ is positive there, as φ(r) = r is
conditionally negative definite. Weights make the error count in encoded values, and less where it is large (Cauchy).

A camera clips what its output cannot hold, or presses it into its gamut; where few samples show that, a straight
continuation would leave the gamut. So h may end in a soft floor, and h⁻¹ begin with its inverse: as soft as the samples
show it, and not at all where the camera clips.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve
from scipy.linalg.lapack import dgeqrf, dormqr
from scipy.spatial.distance import cdist

from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.calibration.soft_floor import floor_width, lowered, raised
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
SOFTNESSES = ((0.0, 0.05, 0.1, 0.2), (0.0, 0.05, 0.1))
"""Softnesses of the floor that are tried, to render and to linearize. The way back is steep where the floor is flat:
with a softer one it would run away beyond the samples."""
SOFT_ENOUGH = 0.9
"""A floor must leave at most this share of the squared error without one: what is gained by chance is not a floor."""
LEAST_SPREAD = 1e-3
"""Samples whose smallest principal deviation is below this lie in a plane, and tell no gamut map."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """A guess of one direction: inverse is linearize, else render; gamut_map: h or h⁻¹, None where it is not known.

    softness: of the floor behind h or before h⁻¹, 0 for none.
    """

    base: MatrixAndResponse
    inverse: bool
    gamut_map: GamutMap | None = None
    softness: float = 0.0

    def __call__(self, x: Array) -> Array:
        """The guess at x (…, 3)."""
        mapped = self.mapped(x)
        if self.inverse:
            return mapped @ np.linalg.inv(self.base.matrix).T
        return self.base.response.encode(mapped)

    def mapped(self, x: Array) -> Array:
        """Linear light of the guess at x (…, 3), after the gamut map; not clipped."""
        linear = self._linear(x)
        if self.gamut_map is None:
            return linear
        mapped = self.gamut_map(self._entered(linear))
        return mapped if self.inverse or not self.softness else raised(mapped, floor_width(linear, self.softness))

    def refit(self, x: Array, y: Array) -> "Continuation":
        """The guess that samples x → y (n, 3) of its direction make, with the same matrix and response.

        Its softness is the one that leaves the least error on them.
        """
        rows = _rows(len(x))
        x, y = x[rows], y[rows]
        straight = Continuation(self.base, self.inverse)
        linear = self._linear(x)
        if not _fills_space(linear):
            return straight
        centres = _spread(linear, min(CENTRES, len(linear) // 2))
        tried: list[tuple[float, Continuation]] = []
        robust, scale = np.ones(len(x)), 0.0
        system: _System | None = None
        for softness in SOFTNESSES[self.inverse]:
            candidate = replace(straight, softness=softness)
            target, slope = candidate._wanted(linear, y)
            if system is None or self.inverse:
                source = candidate._entered(linear)
                system = _System(source, source[centres])
            try:  # the first fit tells the outliers for those after it
                gamut_map, residual, robust = _fit(system, target, slope, robust, 1 if tried else ROUNDS)
            except (LinAlgError, ProfileError):  # colours that coincide
                break
            squares = np.sum((residual * slope) ** 2, axis=1)
            scale = scale or (4.0 * float(np.sqrt(np.median(squares))) + LEAST_SCALE) ** 2
            tried.append((float(np.sum(squares / (1.0 + squares / scale))), replace(candidate, gamut_map=gamut_map)))
            if len(tried) > 1 and tried[-1][0] >= tried[-2][0]:
                break
        if not tried:
            return straight
        least, best = min(tried, key=lambda entry: entry[0])
        none, without = tried[0]
        return best if least < SOFT_ENOUGH * none else without

    def leave_out(self, x: Array, y: Array, held: Sequence[NDArray[np.bool_]]) -> "list[Continuation]":
        """The guesses of the samples x → y (n, 3) less those of each mask (n,), where this is the guess of them all.

        Masks are disjoint. The same centres serve them all, so that the data term is summed once, mask by mask.
        """
        rows = _rows(len(x))
        x, y = x[rows], y[rows]
        if self.gamut_map is None:
            return [self] * len(held)
        linear = self._linear(x)
        source = self._entered(linear)
        target, slope = self._wanted(linear, y)
        system = _System(source, self.gamut_map.centres)
        weight = _sample_weight(slope) * _robust(self.gamut_map(source) - target, slope)
        masks = [mask[rows] for mask in held]
        parts = [system.equations(target[mask], weight[mask], mask) for mask in (*masks, ~np.any(masks, axis=0))]
        normal, right = np.sum([part[0] for part in parts], axis=0), np.sum([part[1] for part in parts], axis=0)
        guesses = []
        for mine in parts[: len(held)]:
            try:
                guess = replace(self, gamut_map=system.solve(normal - mine[0], right - mine[1])[0])
            except (LinAlgError, ProfileError):
                guess = replace(self, gamut_map=None, softness=0.0)
            guesses.append(guess)
        return guesses

    def _linear(self, x: Array) -> Array:
        return self.base.response.linearize(x) if self.inverse else x @ self.base.matrix.T

    def _entered(self, linear: Array) -> Array:
        """What the centres are compared with (n, 3)."""
        if not self.inverse or not self.softness:
            return linear
        return lowered(linear, floor_width(linear, self.softness))[0]

    def _wanted(self, linear: Array, y: Array) -> tuple[Array, Array]:
        """What the centres should make of linear light (n, 3), before the floor, and the slopes that turn errors of
        that into encoded ones; both (n, 3)."""
        if self.inverse:
            return y @ self.base.matrix.T, np.ones_like(y)
        target, slope = self.base.response.linearize(y), _encoding_slope(self.base, y)
        if not self.softness:
            return target, slope
        below, rate = lowered(target, floor_width(linear, self.softness))
        return below, slope / rate


@one_blas_thread
def continuation(base: MatrixAndResponse, x: Array, y: Array, *, inverse: bool) -> Continuation:
    """Fit the gamut map of one direction to samples x → y (n, 3), given matrix and response."""
    return Continuation(base, inverse).refit(x, y)


def _encoding_slope(base: MatrixAndResponse, encoded: Array) -> Array:
    """df/d(linear) at encoded values (n, 3), bounded as in the fit of matrix and response."""
    step = 1.0 / 255.0
    low, high = base.response.linearize(encoded - step), base.response.linearize(encoded + step)
    slope: Array = 1.0 / np.maximum((high - low) / (2 * step), 0.05)
    return slope


def _rows(count: int) -> NDArray[np.intp]:
    """At most MOST_SAMPLES of the samples, the same ones every time."""
    if count <= MOST_SAMPLES:
        return np.arange(count)
    return np.random.default_rng(0).permutation(count)[:MOST_SAMPLES]


def _fills_space(source: Array) -> bool:
    """Whether colours (n, 3) are enough, and not in a plane."""
    if len(source) == 0:
        return False
    spread = np.linalg.svd(source - source.mean(axis=0), compute_uv=False)[-1]
    key = np.rint(source * 1e3).astype(np.int64) @ np.array([1, 1 << 20, 1 << 40])
    return len(np.unique(key)) >= FEWEST_COLOURS and bool(spread >= LEAST_SPREAD * len(source) ** 0.5)


class _System:
    """The least-squares problem of h at samples source (n, 3), with its centres (m, 3).

    Unknowns are the four of the polynomial, then λ in the space that it leaves: orthogonal to 1 and the coordinates of
    the centres, whose basis is kept as the Householder reflectors that span it. Time O(n m²).
    """

    def __init__(self, source: Array, centres: Array) -> None:
        self.centres = centres
        reflectors, self._tau, _, _ = dgeqrf(np.column_stack([np.ones(len(centres)), centres]))
        self._reflectors = reflectors
        self.design = self._project("R", "N", cdist(centres, source).T)
        self.design[:, 0], self.design[:, 1:4] = 1.0, source
        inner = self._project("L", "T", self._project("R", "N", cdist(centres, centres)))
        self.bending = np.zeros_like(inner)
        self.bending[4:, 4:] = -inner[4:, 4:]

    def _project(self, side: str, transposed: str, matrix: Array) -> Array:
        result, _, _ = dormqr(side, transposed, self._reflectors, self._tau, matrix, 64 * max(matrix.shape))
        return np.asarray(result)

    def equations(self, target: Array, weight: Array, rows: NDArray[np.bool_] | None = None) -> tuple[Array, Array]:
        """The normal matrix and right side of some rows, without the bending term."""
        root = np.sqrt(weight)[:, None]
        weighted = (self.design if rows is None else self.design[rows]) * root
        return weighted.T @ weighted, weighted.T @ (target * root)

    def solve(self, normal: Array, right: Array) -> tuple[GamutMap, Array]:
        """h, and the unknowns (4 + …, 3). Raises LinAlgError where the equations are singular."""
        factor = cho_factor(normal + SMOOTHNESS * self.bending, overwrite_a=True, check_finite=False)
        unknowns = cho_solve(factor, right, check_finite=False)
        polynomial = unknowns[:4].copy()
        padded = unknowns.copy()
        padded[:4] = 0.0
        return GamutMap(self.centres, self._project("L", "N", padded), polynomial), unknowns


def _sample_weight(slope: Array) -> Array:
    mean = slope.mean(axis=1)
    weight: Array = (mean / np.median(mean)) ** 2
    return weight


def _robust(residual: Array, slope: Array) -> Array:
    """Cauchy weights in [0, 1] of samples with these residuals and slopes (n, 3)."""
    error = np.linalg.norm(residual, axis=1) * slope.mean(axis=1)
    scale = max(4.0 * float(np.median(error)), LEAST_SCALE)
    weight: Array = 1.0 / (1.0 + (error / scale) ** 2)
    return weight


def _fit(system: _System, target: Array, slope: Array, robust: Array, rounds: int) -> tuple[GamutMap, Array, Array]:
    """h to targets (n, 3), its residuals, and robust weights (n,) from these; robust: those of the first round.

    slope: (n, 3), turns residuals into the units they are judged in.
    """
    weight = _sample_weight(slope)
    for _ in range(rounds):
        gamut_map, unknowns = system.solve(*system.equations(target, weight * robust))
        residual = system.design @ unknowns - target
        robust = _robust(residual, slope)
    return gamut_map, residual, robust


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
