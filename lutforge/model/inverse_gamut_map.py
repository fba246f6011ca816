"""The inverse of a gamut map, solved: the likely linear values that it maps to given ones.

h⁻¹ is no function of its own. For each Y it is the X = Ts R of the white-balanced RAW R ≥ 0 that minimizes, on the
perceptual scale e of the gamut map's colours,

    ‖e(h(Ts R)) − e(Y)‖² + (PRIOR ‖e(R) − e(R₀)‖)²,

by damped Gauss–Newton steps from R₀, the mean of likely scenes that have this Y. Where one R has this Y, the first term
finds it, whatever R₀ is. Near the edge of the gamut and near white a camera takes many R to one Y; there the likely one
counts. A sensor gives no negative RAW: without that bound, strong yellows get any. Slopes of h are differences at R₀,
then updated by Broyden's formula (Broyden 1965, https://doi.org/10.1090/S0025-5718-1965-0198670-6): one evaluation of h
a step.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lutforge.arrays import Array
from lutforge.errors import ProfileError
from lutforge.interpolation import interpolate
from lutforge.model.gamut_map import GamutMap, from_even, to_even
from lutforge.model.lattice import uniform_levels
from lutforge.model.provenance import is_invertible
from lutforge.solvers.gauss_newton import gauss_newton

PRIOR = 0.2
"""How much a deviation from the likely R₀ counts, where the same error of h has 1.

Half and twice as much change the error of linear values by less than 2 % in the mean of simulated cameras.
"""
STEP = 1e-3
"""Of a difference, on the perceptual scale: well above the rounding of the gamut map's single precision."""
TOLERANCE = 1e-2
"""Relative change of the cost that ends a search: of colours that the gamut map never gives little is to be gained."""
MOST_STEPS = 6
LARGEST_TABLE = 65


@dataclass(frozen=True, eq=False)
class SolvedInverse:
    """The inverse of a gamut map.

    forward: h; matrix: Ts (3, 3); likely: (N, N, N, 3), e(X₀) − e(Y) at N even steps of e(Y) from 0 to `top` along each
    axis, X₀ = Ts R₀. Raises ProfileError where the table is not of these, or holds what is no colour.
    """

    forward: GamutMap
    matrix: Array
    likely: Array
    top: float

    def __post_init__(self) -> None:
        if not is_invertible(self.matrix):
            raise ProfileError("inverse gamut map: its matrix is not 3 × 3 numbers that can be inverted")
        size = len(self.likely)
        if self.likely.shape != (size, size, size, 3) or not 2 <= size <= LARGEST_TABLE:
            raise ProfileError("inverse gamut map: its table is not a cube of rows of three numbers")
        if not np.all(np.abs(self.likely) < 1e3) or not 0.0 < self.top < 1e3:  # False for NaN
            raise ProfileError("inverse gamut map: its table holds what is no colour")

    def start(self, linear: ArrayLike) -> Array:
        """X₀ of linear values (…, 3), without a search; beyond the table its end goes on."""
        offset = self.forward.offset
        even = to_even(linear, offset)
        inside = np.clip(even / self.top, 0.0, 1.0)
        correction = interpolate(inside, uniform_levels(len(self.likely)), self.likely, "trilinear")
        return from_even(even + correction, offset)

    def __call__(self, linear: ArrayLike) -> Array:
        """h⁻¹ at linear values (…, 3)."""
        offset = self.forward.offset
        target = np.ascontiguousarray(np.reshape(linear, (-1, 3)), dtype=np.float64)
        likely = np.maximum(self.start(target) @ np.linalg.inv(self.matrix).T, 0.0)
        start = to_even(likely, offset)
        solved = gauss_newton(
            _Search(self.forward, self.matrix, to_even(target, offset), start),
            start,
            lower=0.0,
            tolerance=TOLERANCE,
            small=1e-10,
            most=MOST_STEPS,
        )
        return np.asarray(from_even(solved.value, offset) @ self.matrix.T).reshape(np.shape(linear))


class _Search:
    """Residuals and slopes of the balanced RAW that is sought, on the perceptual scale.

    point, value, slope: by colour, where h was last evaluated for the better, e(h) there, and its slopes (n, 3, 3).
    """

    def __init__(self, forward: GamutMap, matrix: Array, target: Array, start: Array) -> None:
        self.forward = forward
        self.matrix = matrix
        self.target = target
        self.start = start
        self.point = start.copy()
        self.value = self._mapped(start)
        self.slope = np.empty((len(start), 3, 3))
        for axis in range(3):
            moved = start.copy()
            moved[:, axis] += STEP
            self.slope[:, :, axis] = (self._mapped(moved) - self.value) / STEP

    def __call__(self, trial: Array, which: NDArray[np.intp]) -> tuple[Array, Array]:
        """Residuals (a, 6) and their slopes (a, 6, 3) of the colours `which` (a,) at trial (a, 3)."""
        step = trial - self.point[which]
        length = np.einsum("ac,ac->a", step, step)
        moved = length > 0.0
        value = self.value[which]
        slope = self.slope[which]
        if moved.any():
            value[moved] = self._mapped(trial[moved])
            surprise = value[moved] - self.value[which[moved]] - np.einsum("aij,aj->ai", slope[moved], step[moved])
            slope[moved] += surprise[:, :, None] * (step[moved] / length[moved, None])[:, None, :]

        residual = np.hstack([value - self.target[which], PRIOR * (trial - self.start[which])])
        slopes = np.concatenate([slope, np.broadcast_to(PRIOR * np.eye(3), slope.shape)], axis=1)

        # The slope is worth keeping wherever the search goes on from; the point only where it is nearer.
        self.slope[which] = slope
        nearer = self._cost(trial, value, which) < self._cost(self.point[which], self.value[which], which)
        self.point[which[nearer]] = trial[nearer]
        self.value[which[nearer]] = value[nearer]
        return residual, slopes

    def _cost(self, point: Array, value: Array, which: NDArray[np.intp]) -> Array:
        error = np.sum((value - self.target[which]) ** 2, axis=1)
        return np.asarray(error + PRIOR**2 * np.sum((point - self.start[which]) ** 2, axis=1))

    def _mapped(self, even: Array) -> Array:
        """e(h(Ts R)) of e(R) (n, 3)."""
        linear = from_even(even, self.forward.offset) @ self.matrix.T
        return to_even(self.forward(linear), self.forward.offset)
