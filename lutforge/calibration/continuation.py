"""What a lattice continues where it has no samples: matrix, response, and a smooth gamut map between them.

render: f(h(Ts x)), linearize: Ts⁻¹ h⁻¹(f⁻¹(I)). The gamut map is (4.7) with few centres spread over the samples, fitted
to all of them by least squares (`radial_basis`), so that noise and a stray sample do not bend it. Weights make errors
count in encoded values, and less where they are large (Cauchy).

A camera clips what its output cannot hold, or presses it into its gamut; where few samples show that, a straight
continuation would leave the gamut. So h may end in a soft floor, and h⁻¹ begin with its inverse: as soft as the samples
show it, and not at all where the camera clips.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from lutforge.calibration.matrix_and_response import MatrixAndResponse
from lutforge.calibration.radial_basis import RadialBasisFit, RadialBasisProblem, spread
from lutforge.calibration.soft_floor import floor_width, lowered, raised
from lutforge.errors import ProfileError
from lutforge.interpolation import through
from lutforge.model.gamut_map import GamutMap
from lutforge.regression.blas import one_blas_thread

Array = NDArray[np.float64]

CENTRES = 200
CENTRES_PER_FACE_NODE = 2 / 3
"""A small lattice cannot follow so many: a guess for one has at most this many per node of its face."""
MOST_SAMPLES = 3_000
FEW_CENTRES = 64
"""So many, the first as they are spread, tell the outliers before all are fitted."""
FEWEST_COLOURS = 30
"""Fewer distinct ones do not bend a gamut map: matrix and response alone are continued."""
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

    def refit(self, x: Array, y: Array, most_centres: int = CENTRES) -> "Continuation":
        """The guess that samples x → y (n, 3) of its direction make, with the same matrix and response.

        Its softness is the one that leaves the least error on them.
        """
        rows = _rows(len(x))
        x, y = x[rows], y[rows]
        straight = Continuation(self.base, self.inverse)
        linear = self._linear(x)
        if not _fills_space(linear):
            return straight
        centres = spread(linear, min(most_centres, len(linear) // 2))
        tried: list[tuple[float, Continuation]] = []
        robust, scale = np.ones(len(x)), 0.0
        system: RadialBasisProblem | None = None
        fit: RadialBasisFit | None = None
        for softness in SOFTNESSES[self.inverse]:
            candidate = replace(straight, softness=softness)
            target, slope = candidate._wanted(linear, y)
            try:  # the first fit tells the outliers for those after it
                if system is None or self.inverse:
                    source = candidate._entered(linear)
                    system = RadialBasisProblem(source, source[centres])
                elif fit and _error(system.like(fit, target), slope, scale) >= tried[-1][0]:
                    break
                if not tried:
                    few = RadialBasisProblem(source, source[centres[:FEW_CENTRES]])
                    for _ in range(ROUNDS - 1):
                        _, robust = _fit(few, target, slope, robust)
                fit, robust = _fit(system, target, slope, robust)
            except (LinAlgError, ProfileError):  # colours that coincide
                break
            scale = scale or 4.0 * float(np.median(np.linalg.norm(fit.residual * slope, axis=1))) + LEAST_SCALE
            tried.append((_error(fit.residual, slope, scale), replace(candidate, gamut_map=fit.gamut_map)))
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
        system = RadialBasisProblem(source, self.gamut_map.centres)
        weight = _sample_weight(slope) * _robust(self.gamut_map(source) - target, slope)
        masks = [mask[rows] for mask in held]
        parts = [system.equations(target, weight, mask) for mask in (*masks, ~np.any(masks, axis=0))]
        total = np.sum(parts, axis=0)
        guesses = []
        for mine in parts[: len(held)]:
            try:
                guess = replace(self, gamut_map=system.solve(total - mine)[0])
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
        target, slope = through(self.base.response.inverse, y), _encoding_slope(self.base, y)
        if not self.softness:
            return target, slope
        below, rate = lowered(target, floor_width(linear, self.softness))
        return below, slope / rate


@one_blas_thread
def continuation(
    base: MatrixAndResponse, x: Array, y: Array, *, inverse: bool, size: int | None = None
) -> Continuation:
    """Fit the gamut map of one direction to samples x → y (n, 3), given matrix and response.

    size: nodes per axis of the lattice that it is for, where that is known.
    """
    most = CENTRES if size is None else min(CENTRES, int(CENTRES_PER_FACE_NODE * size**2))
    return Continuation(base, inverse).refit(x, y, most)


def _encoding_slope(base: MatrixAndResponse, encoded: Array) -> Array:
    """df/d(linear) at encoded values (n, 3), bounded as in the fit of matrix and response."""
    step = 1.0 / 255.0
    low, high = (through(base.response.inverse, encoded + move) for move in (-step, step))
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
    centred = source - source.mean(axis=0)
    spread = float(np.sqrt(max(np.linalg.eigvalsh(centred.T @ centred)[0], 0.0)))
    key = np.rint(source * 1e3).astype(np.int64) @ np.array([1, 1 << 20, 1 << 40])
    return len(np.unique(key)) >= FEWEST_COLOURS and bool(spread >= LEAST_SPREAD * len(source) ** 0.5)


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


def _error(residual: Array, slope: Array, scale: float) -> float:
    """The robust sum of squared errors (Cauchy)."""
    squares = np.sum((residual * slope) ** 2, axis=1)
    return float(np.sum(squares / (1.0 + squares / scale**2)))


def _fit(system: RadialBasisProblem, target: Array, slope: Array, robust: Array) -> tuple[RadialBasisFit, Array]:
    """h to targets (n, 3), and the robust weights (n,) that its residuals make; robust: those to fit with.

    slope: (n, 3), turns residuals into the units they are judged in.
    """
    fit = system.fit(target, _sample_weight(slope) * robust)
    return fit, _robust(fit.residual, slope)
