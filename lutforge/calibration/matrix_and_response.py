"""Matrix Ts and response f of a style from RAW/JPEG pairs, together, in one robust fit (thesis 4.2.1, 4.2.2).

f⁻¹(I) = Ts x with x = Tw E holds where the gamut map leaves a colour alone. Both sides are linear in what is not known:
the coefficients of f⁻¹ in a basis of curves, the rows of Ts, which sum to 1 (neutrals stay neutral), and, where they
are asked for, the logarithms of gains, about those of the round before. `robust_fit` solves it.

- Errors count in JPEG values, by the slope of f, because noise is uniform there.
- Unsaturated colours have the largest weight: it is not known which colours the gamut map moves, but it moves greys
  least.
- Residuals are compared with those of like tones (`ToneWeights`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import SAMPLE, CurveBasis, emor_basis, spline_basis
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.robust_fit import LinearModel, ToneWeights, robust_fit
from lutforge.colour.saturation import saturation
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.solvers.reweighted import reweighted
from lutforge.solvers.robust_weights import RobustWeights, cauchy
from lutforge.solvers.solution import Status
from lutforge.threads import one_blas_thread

LEAST_UNSATURATED = 8
"""Unsaturated colours that a response or a matrix needs at least."""
LEAST_HUE_SPREAD = 8e-3
"""The chromaticities (shares of r, g, b) of the unsaturated colours must spread in two directions by this much."""
NEAR_WHITE = 0.97
"""Nearer to white even unsaturated colours are moved, some of their pixels clip, and f⁻¹ is steepest: a few of them
turn a plain least-squares fit of Ts by several per cent (0.1 % without them, on the simulated camera)."""
LEAST_SPAN = 0.25
"""The unsaturated colours must span this much of the encoded range, or the curve is a guess."""
ENOUGH_UNSATURATED = 0.15
"""A robust fit starts from the colours below β if they are at least this share of all colours."""
LEAST_SATURATED = 0.35
"""Otherwise it starts from the least saturated colours, this share of all."""
MOST_STARTING_BETA = 0.5
"""It starts from no colours that are more saturated than this, however few there are."""
ENOUGH_GREYS = 20.0
"""β grows until colours count as much as this many grey ones."""
WIDEST_BETA = 20.0
"""The largest β that it grows to: a colour of saturation 1 still counts as a grey one."""
SELECTION = 1.5
"""Power of the odds that the gamut map leaves a colour alone, by which it counts. With 1, of 5,000 colours spread
evenly over RAW, a tenth of them unsaturated, the fit follows the others, and is 3 to 22 codes off near grey on five of
six simulated styles (now 0.4 to 1.8); with 2 it runs away on one of ten chart cameras."""
MOST_BETAS = 3.0
"""Colours beyond so many times β do not count."""
MOST_SAMPLES = 3000
"""The largest number of samples that a fit uses; of more, as many are drawn at random."""

LEAST_SAMPLES = 10
"""Samples that a matrix and a response need at least."""
MATRIX_ROUNDS = 6
"""Rounds of reweighting of the matrix of all colours."""
LONGEST_STEP = 0.5
"""The logarithms of gains change by no more than this in a round: a first step may be far too long."""
STEEPEST = 20.0
"""The largest slope of f that counts, so that no dark sample outweighs all others."""
CURVES_ALIKE = 30.0
"""By how many times a sample's precision the curves of the channels are kept alike, where they are one."""
BENDS_ALIKE = 100.0
"""By how many times the prior's precision of a bend the bends of the three curves are kept alike.

A camera bends its channels at the same tones. Where each bends by its own noise, greys turn to and fro from tone to
tone: by a quarter less with this prior than without it. Between 30 and 10,000 no mean error changes by more than 1 %.
"""

Columns = Callable[[Array], tuple[Array, Array]]
"""A function of RAW (n, 3) that returns what Ts x is made of.

It returns the linear values that known coefficients give (n, 3), and the columns that unknown ones multiply (n, 3, q).
"""


def plainly_unsaturated(encoded: Array, beta: float = BETA) -> Mask:
    """Mask (n,) of the colours (n, 3) that a plain fit trusts: saturation below β, and not near white."""
    return np.asarray((saturation(encoded) < beta) & (encoded.max(axis=1) < NEAR_WHITE))


def in_gamut_weight(chroma: Array, beta: float) -> Array:
    """Return the weight (n,) of colours of saturation chroma (n,), ½ at β.

    There a shift that grows with the third power of the saturation is as large as the noise.
    """
    return np.asarray(1.0 / (1.0 + (chroma / beta) ** 6))


def starting_beta(chroma: Array, beta: float = BETA) -> float:
    """The saturation below which a robust fit starts: β, or what takes in enough of the least saturated colours.

    Few colours lie below β under an illuminant that the white balance does not correct; then the fit starts from those
    that are least saturated, if they lie below a saturation of one half.
    """
    if (chroma < beta).sum() >= max(2 * LEAST_UNSATURATED, ENOUGH_UNSATURATED * len(chroma)):
        return beta
    return float(np.clip(np.quantile(chroma, LEAST_SATURATED), beta, MOST_STARTING_BETA))


def check_tones(encoded: Array, unsaturated: Mask) -> None:
    """Raise CalibrationError where unsaturated colours are too few, or of too few tones."""
    if unsaturated.sum() < LEAST_UNSATURATED:
        raise CalibrationError(
            f"{unsaturated.sum()} unsaturated colours; the response needs {LEAST_UNSATURATED}: "
            "shoot a grey card or a colour chart, at several exposures"
        )
    low, high = np.percentile(encoded[unsaturated, 1], [2, 98])
    if high - low < LEAST_SPAN:
        raise CalibrationError(
            f"the unsaturated colours span JPEG values {255 * low:.0f} to {255 * high:.0f} only: "
            "shoot a grey card or a colour chart at several exposures, from dark to nearly clipped"
        )


@dataclass(frozen=True, eq=False)
class MatrixAndResponse:
    """The conventional model of a camera: a matrix Ts (3, 3), whose rows sum to 1, and a response f."""

    matrix: Array
    response: Response

    def render(self, x: Array) -> Array:
        """White-balanced RAW (…, 3) → encoded (…, 3), in [0, 1]."""
        return self.response.encode(x @ self.matrix.T)

    def linearize(self, encoded: Array) -> Array:
        """Encoded (…, 3) → white-balanced RAW (…, 3), not clipped."""
        return self.response.linearize(encoded) @ np.linalg.inv(self.matrix).T


@dataclass(frozen=True, eq=False)
class MatrixAndResponseFit(MatrixAndResponse):
    """A matrix and response that were fitted to samples.

    in_gamut: (n,) the weight in [0, 1] of a sample by its saturation, 1 where the gamut map leaves its colour alone;
    status: how the rounds ended.
    """

    in_gamut: Array
    status: Status


@one_blas_thread
def fit_matrix_and_response(
    x: Array, encoded: Array, beta: float = BETA, curves: int = CURVES, *, saturates: bool = False
) -> MatrixAndResponseFit:
    """Fit Ts and f to white-balanced RAW x (n, 3) and JPEG values encoded (n, 3) in [0, 1], neither clipped.

    f⁻¹ is made of EMoR's curves first, whose shape beyond the samples is that of real cameras, then twice a spline
    around the mean of the channels, which follows what EMoR cannot. beta: the saturation below which a colour surely
    counts; curves: of EMoR. saturates: 1 is where the sensor does, which cameras render white: f⁻¹(1) ≤ 1, however
    dark the samples are. Raises CalibrationError below 10 samples.
    """
    in_gamut, problem = _joint_fit(x, encoded, beta)

    def fit(basis: CurveBasis) -> Status:
        return robust_fit(problem, basis.with_white_by_one() if saturates else basis)

    status = fit(emor_basis(curves))
    for _ in range(2):
        status = fit(spline_basis(problem.response.inverse.mean(axis=1)))
    matrix = matrix_of_rows(problem.coefficients)
    return MatrixAndResponseFit(matrix, problem.response, in_gamut, status)


@one_blas_thread
def fit_typical_response(x: Array, encoded: Array) -> MatrixAndResponse:
    """Fit Ts and f to white-balanced RAW x (n, 3) and JPEG values encoded (n, 3), with f among EMoR's curves.

    Without the splines of `fit_matrix_and_response` this takes a third of its time, which matters where many hypotheses
    are compared. Raises CalibrationError below 10 samples.
    """
    _, problem = _joint_fit(x, encoded, BETA)
    robust_fit(problem, emor_basis(CURVES))
    return MatrixAndResponse(matrix_of_rows(problem.coefficients), problem.response)


def _joint_fit(x: Array, encoded: Array, beta: float) -> tuple[Array, "JointFit"]:
    """The weight (n,) of each sample by its saturation, and the problem of matrix and response with these weights.

    Raises CalibrationError below 10 samples.
    """
    if len(x) < LEAST_SAMPLES:
        raise CalibrationError(
            f"{len(x)} samples cannot determine a matrix and a response; at least {LEAST_SAMPLES} are needed"
        )
    chroma = saturation(encoded)
    beta = _wide_enough(chroma, beta)
    rows = np.flatnonzero(chroma < MOST_BETAS * beta)
    if len(rows) > MOST_SAMPLES:  # the same ones every time
        rows = np.random.default_rng(0).choice(rows, MOST_SAMPLES, replace=False, shuffle=False)
    in_gamut = in_gamut_weight(chroma, beta)
    weights = ToneWeights(encoded[rows].mean(axis=1), in_gamut[rows] ** SELECTION)
    return in_gamut, JointFit(x[rows], encoded[rows], weights, neutral_rows)


def neutral_rows(x: Array) -> tuple[Array, Array]:
    """The columns of a matrix whose rows sum to 1: of each channel the other two, less itself."""
    return x, np.stack([x[:, [c for c in range(3) if c != channel]] - x[:, [channel]] for channel in range(3)], axis=1)


def matrix_of_rows(coefficients: Array) -> Array:
    """The matrix (3, 3) of the coefficients (3, 2) of `neutral_rows`."""
    matrix = np.zeros((3, 3))
    for channel, share in enumerate(coefficients):
        matrix[channel, [c for c in range(3) if c != channel]] = share
        matrix[channel, channel] = 1.0 - share.sum()
    return matrix


class JointFit:
    """The problem f⁻¹(I) = known + columns · m of RAW x, whose channels are multiplied by exp(changes · s).

    x: (n, 3); encoded: (n, 3); weights: of the samples, by their residuals in JPEG values; columns: of RAW, which is
    linear in it; changes: (n, p), such as one for each shot with 1 where a sample is of it; alike: f is the same for
    all channels, and 1 at 1.

    After the rounds: response: f; coefficients: m (3, q); logs: s (p,), the sum of all rounds; gain: exp(changes · s)
    (n, 1); weight: (n,).
    """

    subtracted: Array | None = None

    def __init__(
        self,
        x: Array,
        encoded: Array,
        weights: ToneWeights,
        columns: Columns,
        changes: Array | None = None,
        response: Response | None = None,
        *,
        alike: bool = False,
    ) -> None:
        self.x = x
        self.encoded = encoded
        self.weights = weights
        self.columns = columns
        self.changes = np.zeros((len(x), 0)) if changes is None else changes
        self.alike = alike

        self.weight = weights.prior
        self.response = response or Response(np.array([[0.0] * 3, [1.0] * 3]))
        self.coefficients = np.zeros((3, 0))
        self.logs = np.zeros(self.changes.shape[1])
        self.gain = np.ones((len(x), 1))

    def linear_model(self) -> LinearModel:
        """The linear values of the next round, with gains as their derivatives at those of the last round."""
        known, columns = self.columns(self.gain * self.x)
        shared = np.zeros((len(known), 3, len(self.logs)))
        if self.coefficients.size:
            for place in range(len(self.logs)):
                shared[..., place] = self._modelled(self.changes[:, [place]] * self.gain * self.x)
        return LinearModel(known, columns, shared)

    def precision(self) -> Array:
        """The precision (n, 3) of linear values, by that of JPEG values and the slope of f."""
        return np.asarray(SAMPLE * self.weight[:, None] * encoding_slope(self.response, self.encoded) ** 2)

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """The prior: the curves bend alike, curves that are one stay one, and gains that nothing determines stay."""
        from_mean = np.eye(3) - 1.0 / 3.0
        bends = np.sqrt(BENDS_ALIKE) * np.kron(from_mean, basis.bends)
        differences = np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]])[: 2 if self.alike else 0]
        ties = CURVES_ALIKE * np.sqrt(SAMPLE) * np.kron(differences, np.eye(basis.design.shape[1]))
        return np.vstack([bends, ties]), np.eye(len(self.logs))

    def update(self, curves: Array, by_channel: Array, shared: Array) -> float:
        """Take the solution of a round, and weigh by its residuals; return the relative change of the weights."""
        self.response, self.coefficients = Response(curves), by_channel
        step = np.clip(shared, -LONGEST_STEP, LONGEST_STEP)
        self.logs = self.logs + step
        self.gain = self.gain * np.exp(self.changes @ step)[:, None]

        residual = self.response.encode(self._modelled(self.gain * self.x)) - self.encoded
        last_weight = self.weight
        self.weight = self.weights(np.asarray(np.linalg.norm(residual, axis=1)))
        return float(np.abs(self.weight - last_weight).sum() / self.weight.sum())

    def _modelled(self, x: Array) -> Array:
        """The linear values (n, 3) that the present coefficients give of RAW (n, 3)."""
        known, columns = self.columns(x)
        return np.asarray(known + np.einsum("ncq,cq->nc", columns, self.coefficients))


@one_blas_thread
def with_matrix_of_all(fit: MatrixAndResponse, x: Array, encoded: Array) -> MatrixAndResponse:
    """Fit the matrix anew to all samples x, encoded (n, 3), saturated ones too, and keep the response."""
    linear, slope = fit.response.linearize(encoded), encoding_slope(fit.response, encoded)
    known, columns = neutral_rows(x)
    robust = RobustWeights(cauchy, multiple=4, least=2 / 255)

    def solve(weight: Array) -> Array:
        rows = []
        for c in range(3):
            weighted = columns[:, c].T * (weight * slope[:, c] ** 2)
            normal = weighted @ columns[:, c]
            normal += 1e-9 * np.sum(weight * slope[:, c] ** 2) * np.eye(len(normal))
            rows.append(np.linalg.solve(normal, weighted @ (linear - known)[:, c]))
        return matrix_of_rows(np.stack(rows))

    def weights(matrix: Array) -> Array:
        return robust(encoded_residual(fit.response, matrix, x, encoded))

    return MatrixAndResponse(reweighted(solve, weights, weights(fit.matrix), rounds=MATRIX_ROUNDS), fit.response)


def _wide_enough(chroma: Array, beta: float) -> float:
    """Return the least β, from the given one on, by which colours of saturations (n,) count as enough grey ones.

    Of fewer than twice as many colours half of them are enough.
    """
    enough = min(ENOUGH_GREYS, 0.5 * len(chroma))

    def missing(beta: float) -> float:
        return enough - float((in_gamut_weight(chroma, beta) ** SELECTION).sum())

    return beta if missing(beta) <= 0 else brentq(missing, beta, WIDEST_BETA, xtol=1e-3)


def encoding_slope(response: Response, encoded: Array) -> Array:
    """The slope df/d(linear) (n, 3) at encoded values (n, 3), cut to the steepest that counts."""
    codes = np.linspace(0.0, 1.0, len(response.inverse))
    step = np.gradient(response.inverse, codes, axis=0)
    slope = np.stack([np.interp(encoded[:, c], codes, step[:, c]) for c in range(3)], axis=1)
    return np.asarray(1.0 / np.maximum(slope, 1.0 / STEEPEST))


def encoded_residual(response: Response, matrix: Array, x: Array, encoded: Array) -> Array:
    """The error ‖f(Ts x) − I‖ (n,) of white-balanced RAW x and JPEG values, each (n, 3)."""
    return np.asarray(np.linalg.norm(response.encode(x @ matrix.T) - encoded, axis=1))
