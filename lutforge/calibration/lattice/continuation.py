"""The prior mean of a lattice: matrix and response, corrected by a smooth function that is fitted to the samples.

Where a lattice has no samples, it continues this function. That of a render gives the values of a cube in front of its
output curve: c(Ts x) + r(e(Ts x)), where c is the curve's own continuation of linear light across the clipping. That of
a linearization gives RAW: Ts⁻¹ e⁻¹(z + r(z)) with z = e(f⁻¹(I)). e is the even scale of `model.gamut_map`, on which
steps of dark colours are as large as they look.

The correction r is a sum of radial basis functions with few centres spread over the samples. It is fitted to all of
them by least squares (`radial_basis`) with robust weights (Cauchy), so that noise and outliers hardly change it. Beyond
the samples r continues smoothly, and goes to 0 at black.

There are two candidates for Ts: the matrix of unsaturated colours, and the matrix that suits all colours, from which r
extrapolates more safely. The first is taken where r is clearly smaller with it, as for a gamut map that leaves most
colours alone; otherwise the second.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError

from lutforge.arrays import Array, Mask
from lutforge.calibration.lattice.output_curve import OutputCurve, output_curve
from lutforge.calibration.physical.matrix_and_response import MatrixAndResponse, with_matrix_of_all
from lutforge.calibration.physical.radial_basis import RadialBasis, RadialBasisProblem, spread
from lutforge.model.gamut_map import even_slope, from_even, to_even
from lutforge.solvers.blas import one_blas_thread
from lutforge.solvers.robust_weights import RobustWeights, cauchy

OFFSET = 0.005
"""ε of the even scale."""
TRIAL_CENTRES = 54
"""The number of centres with which the two matrices are compared: as many as for a lattice of 9 nodes per axis."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """The prior mean of one direction. base: matrix and response; curve: the output curve of a render, else None.

    correction: r, None where the samples do not determine it; outlier_scale: the error at which a sample has half its
    weight in the fit of r.
    """

    base: MatrixAndResponse
    curve: OutputCurve | None
    correction: RadialBasis | None = None
    outlier_scale: float = np.inf

    def __call__(self, x: Array) -> Array:
        """The prior mean at x (…, 3): encoded, or RAW."""
        values = self.values(x)
        return values if self.curve is None else self.curve.to_encoded(values)

    def values(self, x: Array) -> Array:
        """The values of the cube at x (…, 3), in front of the output curve, or RAW; not clipped."""
        linear = self._linear(x)
        if self.curve is not None:
            values = self.curve.continued(linear)
            return values if self.correction is None else values + self.correction(to_even(linear, OFFSET))
        if self.correction is not None:
            even = to_even(linear, OFFSET)
            linear = from_even(even + self.correction(even), OFFSET)
        return np.asarray(linear @ np.linalg.inv(self.base.matrix).T)

    def refit(self, x: Array, y: Array, most_centres: int = 200) -> "Continuation":
        """Return the prior mean with the same matrix and response, its correction fitted to samples x → y (n, 3)."""
        return self._corrected(self._trial(x, y, most_centres))

    def _trial(self, x: Array, y: Array, most_centres: int) -> "_Trial | None":
        """Fit a correction of few centres; None where the samples do not determine it."""
        pairs = self._pairs(x, y, most_centres)
        try:
            return None if pairs is None else pairs.trial()
        except LinAlgError:  # colours that coincide
            return None

    def _corrected(self, trial: "_Trial | None") -> "Continuation":
        """The prior mean with a correction of all centres, fitted to the samples of a trial."""
        straight = replace(self, correction=None, outlier_scale=np.inf)
        if trial is None:
            return straight
        pairs = trial.pairs
        try:
            correction, _ = pairs.problem.fit(pairs.target, pairs.weight * trial.robust)
        except LinAlgError:
            return straight
        return replace(straight, correction=correction, outlier_scale=trial.outlier_scale)

    def _pairs(self, x: Array, y: Array, most_centres: int) -> "_Pairs | None":
        """The data that r is fitted to; None where the samples do not determine it."""
        rows = _rows(len(x), 20_000)
        linear = self._linear(x[rows])
        if not _fills_space(linear):
            return None
        even = to_even(linear, OFFSET)
        chosen = spread(even, min(most_centres, len(even) // 2))
        kept = np.arange(len(rows)) < _enough(len(chosen))
        kept[chosen] = True  # the outermost samples among them
        return _Pairs(even[chosen], *self._with_greys(*self._correction_data(linear[kept], y[rows[kept]])))

    def _with_greys(self, source: Array, target: Array, weight: Array) -> tuple[Array, Array, Array]:
        """Samples as `_correction_data` makes them, and behind them dark greys, which nothing moves.

        The gamut map leaves them alone, black the first; each counts as one sample.
        """
        greys = np.linspace(0.0, 0.3, 11)[:, None].repeat(3, axis=1)
        return (
            np.concatenate([source, greys]),
            np.concatenate([target, np.zeros_like(greys)]),
            np.concatenate([weight, np.ones(len(greys))]),
        )

    def leave_out(self, x: Array, y: Array, held: Sequence[Mask]) -> "list[Continuation]":
        """Fit the correction again without the samples of each mask (n,); this one was fitted to all x → y (n, 3).

        Masks are disjoint. The same centres serve them all, so that the data term is summed once, mask by mask.
        """
        if self.correction is None:
            return [self] * len(held)
        rows = _rows(len(x), _enough(len(self.correction.centres)))
        x, y = x[rows], y[rows]
        source, target, weight = self._with_greys(*self._correction_data(self._linear(x), y))
        system = RadialBasisProblem(source, self.correction.centres)
        weight = weight * cauchy(_error(self.correction(source) - target, weight) / self.outlier_scale)
        masks = [np.concatenate([mask[rows], np.zeros(len(source) - len(x), dtype=np.bool_)]) for mask in held]
        parts = [system.equations(target, weight, mask) for mask in (*masks, ~np.any(masks, axis=0))]
        total = np.sum(parts, axis=0)
        found = []
        for mine in parts[: len(held)]:
            try:
                fitted = replace(self, correction=system.solve(total - mine)[0])
            except LinAlgError:
                fitted = replace(self, correction=None)
            found.append(fitted)
        return found

    def _linear(self, x: Array) -> Array:
        """Linear light that matrix or response alone make of x (…, 3)."""
        return np.asarray(self.base.response.linearize(x) if self.curve is None else x @ self.base.matrix.T)

    def _correction_data(self, linear: Array, y: Array) -> tuple[Array, Array, Array]:
        """e of linear light (n, 3), what r should be there (n, 3), and how much its error counts (n,)."""
        source = to_even(linear, OFFSET)
        if self.curve is not None:
            return source, self.curve.to_values(y) - self.curve.continued(linear), np.ones(len(y))
        linear_of_y = y @ self.base.matrix.T
        slope = 1.0 / even_slope(linear_of_y, OFFSET).mean(axis=1)  # errors count in linear light
        return source, to_even(linear_of_y, OFFSET) - source, (slope / np.median(slope)) ** 2


@one_blas_thread
def continuation(
    base: MatrixAndResponse,
    x: Array,
    y: Array,
    *,
    inverse: bool,
    size: int | None = None,
    curve: OutputCurve | None = None,
) -> Continuation:
    """Fit the prior mean of one direction to samples x → y (n, 3), given matrix and response.

    size: nodes per axis of the lattice that it is for, where that is known; curve: `output_curve(base.response)`,
    where that is made already.
    """
    most = 200 if size is None else min(1_000, int(2 / 3 * size**2))  # what a lattice can follow: by nodes of its face
    if inverse:
        return Continuation(with_matrix_of_all(base, *_some(y, x)), None).refit(x, y, most)
    few = _with_better_matrix(base, x, y, curve or output_curve(base.response))
    return few if most <= TRIAL_CENTRES else few.refit(x, y, most)


def _with_better_matrix(base: MatrixAndResponse, x: Array, encoded: Array, curve: OutputCurve) -> Continuation:
    """Return the prior mean of a render with few centres, and with the one of two matrices that suits the samples."""
    x, encoded = _some(x, encoded)
    own, safer = (Continuation(each, curve) for each in (base, with_matrix_of_all(base, x, encoded)))
    of_own, of_safer = (each._trial(x, encoded, TRIAL_CENTRES) for each in (own, safer))
    own_is_simpler = of_own is not None and (of_safer is None or of_own.rms < 0.92 * of_safer.rms)
    return own._corrected(of_own) if own_is_simpler else safer._corrected(of_safer)


def _some(x: Array, encoded: Array) -> tuple[Array, Array]:
    """The samples that the two matrices are compared on."""
    rows = _rows(len(x), _enough(TRIAL_CENTRES))
    return x[rows], encoded[rows]


@dataclass(frozen=True, eq=False)
class _Pairs:
    """The data that r is fitted to. source: e of linear light (n, 3); target: what r should be there (n, 3).

    centres: (m, 3); weight: (n,).
    """

    centres: Array
    source: Array
    target: Array
    weight: Array

    @cached_property
    def problem(self) -> RadialBasisProblem:
        """The fit of functions at all centres."""
        return RadialBasisProblem(self.source, self.centres)

    def trial(self) -> "_Trial":
        """Fit few centres, with weights that find the outliers. Raises LinAlgError where colours coincide."""
        robust, most = np.ones(len(self.source)), 100
        few = self.problem if len(self.centres) <= most else RadialBasisProblem(self.source, self.centres[:most])
        for _ in range(2):
            error = _error(few.fit(self.target, self.weight * robust)[1], self.weight)
            scale = RobustWeights(cauchy, multiple=4.0, least=4.0 / 255.0).scale(error)
            robust = cauchy(error / scale)
        return _Trial(self, robust, scale, float(np.sqrt(robust @ error**2 / robust.sum())))


@dataclass(frozen=True, eq=False)
class _Trial:
    """A fit of few centres.

    robust: weights (n,), small for outliers; outlier_scale: the error at which a sample has half its weight; rms: root
    mean square of the errors with these weights.
    """

    pairs: _Pairs
    robust: Array
    outlier_scale: float
    rms: float


def _rows(count: int, most: int) -> NDArray[np.intp]:
    """Choose at most `most` samples in random order, the same ones every time: of fewer, the first of more."""
    return np.random.default_rng(0).permutation(count)[:most]


def _enough(centres: int) -> int:
    """Return how many samples suffice to fit functions with this many centres."""
    return min(3_000, 20 * centres)


def _fills_space(source: Array) -> bool:
    """True where at least 30 of the colours (n, 3) differ and they do not lie in a plane."""
    if len(source) == 0:
        return False
    centred = source - source.mean(axis=0)
    spread = float(np.sqrt(max(np.linalg.eigvalsh(centred.T @ centred)[0], 0.0)))
    if spread < 1e-3 * len(source) ** 0.5:  # the smallest principal deviation, in linear light
        return False
    return any(_distinct(part) >= 30 for part in (source[:300], source))  # the first 300 mostly suffice


def _distinct(source: Array) -> int:
    """How many of the colours (n, 3) differ."""
    key = np.sort(np.rint(source * 1e3).astype(np.int64) @ np.array([1, 1 << 20, 1 << 40]))
    return 1 + int(np.count_nonzero(key[1:] != key[:-1]))


def _error(residual: Array, weight: Array) -> Array:
    """(n,): the lengths of residuals (n, 3), which count by weight (n,)."""
    return np.asarray(np.sqrt(np.einsum("nc,nc->n", residual, residual) * weight))
