"""The guess that a lattice follows where it has no samples: matrix and response, corrected by what the samples show.

The guess of a render gives the values of a cube in front of its output curve: c(Ts x) + r(e(Ts x)), where c is the
curve's own continuation of linear light across the clipping. The guess of a linearization gives RAW: Ts⁻¹ e⁻¹(z + r(z))
with z = e(f⁻¹(I)). e is the even scale of `model.gamut_map`, on which dark colours lie as far apart as they look. The
correction r is a sum of radial basis functions with few centres spread over the samples, fitted to all of them by least
squares (`radial_basis`), so that noise and a stray sample do not bend it; large errors count less (Cauchy). Beyond the
samples r continues smoothly, to 0 at black.

Ts is that of unsaturated colours where r is clearly simpler then, as of a gamut map that leaves most colours alone;
else that which suits all colours, from which r runs on more safely.
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
"""The number of functions that tell which matrix is continued: those of the guess for a lattice of 9 nodes per axis."""


@dataclass(frozen=True, eq=False)
class Continuation:
    """The guess of one direction. base: matrix and response; curve: the output curve of a render, else None.

    bend: r, None where the samples do not determine it; half: the error at which a sample counted half in its fit.
    """

    base: MatrixAndResponse
    curve: OutputCurve | None
    bend: RadialBasis | None = None
    half: float = np.inf

    def __call__(self, x: Array) -> Array:
        """The guess at x (…, 3): encoded, or RAW."""
        values = self.values(x)
        return values if self.curve is None else self.curve.to_encoded(values)

    def values(self, x: Array) -> Array:
        """What a cube should hold at x (…, 3): values before the curve, or RAW; not clipped."""
        linear = self._linear(x)
        if self.curve is not None:
            values = self.curve.continued(linear)
            return values if self.bend is None else values + self.bend(to_even(linear, OFFSET))
        if self.bend is not None:
            even = to_even(linear, OFFSET)
            linear = from_even(even + self.bend(even), OFFSET)
        return np.asarray(linear @ np.linalg.inv(self.base.matrix).T)

    def refit(self, x: Array, y: Array, most_centres: int = 200) -> "Continuation":
        """The guess that samples x → y (n, 3) of its direction make, with the same matrix and response."""
        return self._bent(self._trial(x, y, most_centres))

    def _trial(self, x: Array, y: Array, most_centres: int) -> "_Trial | None":
        """What few functions make of samples; None where these cannot tell them."""
        pairs = self._pairs(x, y, most_centres)
        try:
            return None if pairs is None else pairs.trial()
        except LinAlgError:  # colours that coincide
            return None

    def _bent(self, trial: "_Trial | None") -> "Continuation":
        """The guess of all functions, fitted to the samples of a trial."""
        straight = replace(self, bend=None, half=np.inf)
        if trial is None:
            return straight
        pairs = trial.pairs
        try:
            bend, _ = pairs.problem.fit(pairs.target, pairs.weight * trial.robust)
        except LinAlgError:
            return straight
        return replace(straight, bend=bend, half=trial.half)

    def _pairs(self, x: Array, y: Array, most_centres: int) -> "_Pairs | None":
        """What r is fitted to; None where the samples cannot tell it."""
        rows = _rows(len(x), 20_000)
        linear = self._linear(x[rows])
        if not _fills_space(linear):
            return None
        even = to_even(linear, OFFSET)
        chosen = spread(even, min(most_centres, len(even) // 2))
        kept = np.arange(len(rows)) < _enough(len(chosen))
        kept[chosen] = True  # the outermost samples among them
        return _Pairs(even[chosen], *self._with_greys(*self._wanted(linear[kept], y[rows[kept]])))

    def _with_greys(self, source: Array, target: Array, weight: Array) -> tuple[Array, Array, Array]:
        """Samples as `_wanted` makes them, and behind them dark greys, which nothing moves.

        The gamut map leaves them alone, black the first; each counts as one sample.
        """
        greys = np.linspace(0.0, 0.3, 11)[:, None].repeat(3, axis=1)
        return (
            np.concatenate([source, greys]),
            np.concatenate([target, np.zeros_like(greys)]),
            np.concatenate([weight, np.ones(len(greys))]),
        )

    def leave_out(self, x: Array, y: Array, held: Sequence[Mask]) -> "list[Continuation]":
        """The guesses of the samples x → y (n, 3) less those of each mask (n,), where this is the guess of them all.

        Masks are disjoint. The same centres serve them all, so that the data term is summed once, mask by mask.
        """
        if self.bend is None:
            return [self] * len(held)
        rows = _rows(len(x), _enough(len(self.bend.centres)))
        x, y = x[rows], y[rows]
        source, target, weight = self._with_greys(*self._wanted(self._linear(x), y))
        system = RadialBasisProblem(source, self.bend.centres)
        weight = weight * cauchy(_error(self.bend(source) - target, weight) / self.half)
        masks = [np.concatenate([mask[rows], np.zeros(len(source) - len(x), dtype=np.bool_)]) for mask in held]
        parts = [system.equations(target, weight, mask) for mask in (*masks, ~np.any(masks, axis=0))]
        total = np.sum(parts, axis=0)
        guesses = []
        for mine in parts[: len(held)]:
            try:
                guess = replace(self, bend=system.solve(total - mine)[0])
            except LinAlgError:
                guess = replace(self, bend=None)
            guesses.append(guess)
        return guesses

    def _linear(self, x: Array) -> Array:
        """Linear light that matrix or response alone make of x (…, 3)."""
        return np.asarray(self.base.response.linearize(x) if self.curve is None else x @ self.base.matrix.T)

    def _wanted(self, linear: Array, y: Array) -> tuple[Array, Array, Array]:
        """e of linear light (n, 3), what r should be there (n, 3), and how much its error counts (n,)."""
        source = to_even(linear, OFFSET)
        if self.curve is not None:
            return source, self.curve.to_values(y) - self.curve.continued(linear), np.ones(len(y))
        wanted = y @ self.base.matrix.T
        slope = 1.0 / even_slope(wanted, OFFSET).mean(axis=1)  # errors count in linear light
        return source, to_even(wanted, OFFSET) - source, (slope / np.median(slope)) ** 2


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
    """Fit the guess of one direction to samples x → y (n, 3), given matrix and response.

    size: nodes per axis of the lattice that it is for, where that is known; curve: `output_curve(base.response)`,
    where that is made already.
    """
    most = 200 if size is None else min(1_000, int(2 / 3 * size**2))  # what a lattice can follow: by nodes of its face
    if inverse:
        return Continuation(with_matrix_of_all(base, *_some(y, x)), None).refit(x, y, most)
    clearer = _clearer(base, x, y, curve or output_curve(base.response))
    return clearer if most <= TRIAL_CENTRES else clearer.refit(x, y, most)


def _clearer(base: MatrixAndResponse, x: Array, encoded: Array, curve: OutputCurve) -> Continuation:
    """Return the rendering guess of few functions, with the one of two matrices that the samples prefer."""
    x, encoded = _some(x, encoded)
    own, safer = (Continuation(each, curve) for each in (base, with_matrix_of_all(base, x, encoded)))
    of_own, of_safer = (guess._trial(x, encoded, TRIAL_CENTRES) for guess in (own, safer))
    clear = of_own is not None and (of_safer is None or of_own.rms < 0.92 * of_safer.rms)
    return own._bent(of_own) if clear else safer._bent(of_safer)


def _some(x: Array, encoded: Array) -> tuple[Array, Array]:
    """Samples that tell which matrix is continued."""
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
        """Fits of few functions, which tell the outliers. Raises LinAlgError where colours coincide."""
        robust, most = np.ones(len(self.source)), 100
        few = self.problem if len(self.centres) <= most else RadialBasisProblem(self.source, self.centres[:most])
        for _ in range(2):
            error = _error(few.fit(self.target, self.weight * robust)[1], self.weight)
            half = RobustWeights(cauchy, multiple=4.0, least=4.0 / 255.0).scale(error)
            robust = cauchy(error / half)
        return _Trial(self, robust, half, float(np.sqrt(robust @ error**2 / robust.sum())))


@dataclass(frozen=True, eq=False)
class _Trial:
    """A fit of few functions.

    robust: weights (n,) that tell the outliers; half: the error that counts half; rms: root mean square of the others.
    """

    pairs: _Pairs
    robust: Array
    half: float
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
