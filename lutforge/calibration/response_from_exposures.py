"""The camera response f from exposure pairs (thesis 4.2.1): EMoR in the log domain (4.3, 4.4), or another basis.

Linear least squares under the inequalities that make f⁻¹ rise: plain, or robust.
"""

from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import CurveBasis, log_emor_basis
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.matrix_and_response import check_tones, starting_beta
from lutforge.calibration.options import BETA
from lutforge.calibration.robust_fit import LinearModel, robust_fit
from lutforge.model.emor import log_inverse_emor
from lutforge.model.response import Response
from lutforge.solvers.robust_weights import RobustWeights, geman_mcclure

PAIR_WEIGHTS = RobustWeights(geman_mcclure, multiple=3.0, least=1.0)
"""Weights of pairs by their residuals, in standard deviations of their noise."""
ROUNDING = 0.4 / 255
"""Standard deviation of a JPEG value: rounding, and a little noise."""
SAME_SCALE = 0.02
"""Standard deviation of a channel's f⁻¹ at middle grey from the others', and, in the first round, of log f⁻¹."""
LEAST_NOISE = 1e-3
"""Least standard deviation of the logarithm of a ratio, where the curves are flat."""
COMMON_POWER = 1e8
"""Precision by which errors that grow with the exposure are ruled out."""
ROUNDS_BY_NOISE, ROBUST_ROUNDS = 2, 10
"""Rounds in which pairs count by their noise alone, so that a first curve is known; then rounds of reweighting."""
SLOPE_SPAN = 16 / 255
"""Span of JPEG values over which the slope of a curve is measured: a few times the noise of a code."""


@dataclass(frozen=True, eq=False)
class ExposureResponseFit:
    """f of one style from exposure pairs, f(1) = 1. shot_error: by shot, the log of true over stated exposure."""

    response: Response
    shot_error: dict[str, float]


def fit_response_to_exposures(
    pairs: ExposurePairs, beta: float = BETA, basis: CurveBasis | None = None
) -> ExposureResponseFit:
    """Fit f to JPEG values of the same surfaces in differently exposed shots, and each shot's exposure error.

    The fit starts from the colours below a saturation β, and then weighs each pair by its residual. basis: the curves
    that log f⁻¹ is one of; EMoR's 15 unless given. Raises CalibrationError where there are no pairs of unsaturated
    colours, or they span too few tones.
    """
    basis = basis or log_emor_basis()
    unsaturated = pairs.saturation < starting_beta(pairs.saturation, beta)
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(unsaturated, 2))

    by_noise = _ExposuresByNoise(pairs, unsaturated)
    robust_fit(by_noise, basis, ROUNDS_BY_NOISE)
    problem = _RobustExposures(by_noise)
    robust_fit(problem, basis, ROBUST_ROUNDS)
    return _response_of(problem)


def fit_response_by_least_squares(
    pairs: ExposurePairs, beta: float = BETA, basis: CurveBasis | None = None
) -> ExposureResponseFit:
    """Fit f by plain least squares to the pairs below a saturation β, which all count alike (thesis 4.2.1, 4.4).

    With a β of infinity no outlier is removed: the conventional way that the thesis compares with (Fig. 4.2, [24]).
    The basis and the errors are those of `fit_response_to_exposures`.
    """
    unsaturated = pairs.saturation < beta
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(unsaturated, 2))
    problem = _Exposures(pairs, unsaturated)
    robust_fit(problem, basis or log_emor_basis(), 1)
    return _response_of(problem)


def _response_of(problem: "_Exposures") -> ExposureResponseFit:
    """The response and the exposure errors of a solved problem."""
    pairs = problem.pairs
    logs = _continued_to_white(problem.logs, pairs, problem.weight)
    table = np.exp(logs - logs[-1])
    table[0] = 0.0
    named = {name: float(value) for name, value in zip(pairs.shots, problem.errors, strict=True)}
    return ExposureResponseFit(Response(np.maximum.accumulate(table)), named)


class _Exposures:
    """The problem g(I') − g(I) = log k' + the exposure error of the second shot − that of the first, for g = log f⁻¹.

    unsaturated: (n,) the pairs that count. After the rounds: logs: g (k, 3); errors: (shots,); weight: (n,).
    """

    def __init__(self, pairs: ExposurePairs, unsaturated: Mask) -> None:
        self.pairs = pairs
        self.unsaturated = unsaturated
        self.encoded: Array = pairs.second
        self.subtracted: Array | None = pairs.first
        self.weight = unsaturated.astype(np.float64)
        self.noise = np.full(pairs.first.shape, SAME_SCALE)
        # (n, shots): 1 for the second shot of a pair, −1 for its first
        shots = np.arange(len(pairs.shots))
        self.signs_of_shots = (pairs.second_shot[:, None] == shots) * 1.0 - (pairs.first_shot[:, None] == shots)

    def linear_model(self) -> LinearModel:
        """The ratio as stated, which is known, and errors of the shots, which the channels have in common."""
        known = np.repeat(self.pairs.log_ratio[:, None], 3, axis=1)
        shared = np.repeat(self.signs_of_shots[:, None, :], 3, axis=1)
        return LinearModel(known, np.zeros((*known.shape, 0)), shared)

    def precision(self) -> Array:
        """The precision (n, 3) by the noise of the two JPEG values; in (4.4) all pairs count alike."""
        return np.asarray(self.weight[:, None] / self.noise**2)

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """The prior by which stated exposures are right within their spread, and do not err by a power.

        A common power of f⁻¹ and of all exposures explains the data as well: errors that grow with the exposure are
        ruled out, so that the exposures as stated fix the power.
        """
        exposure = self.pairs.shot_exposure
        ruled_out = COMMON_POWER * np.outer(exposure, exposure)
        return np.zeros((0, 3 * basis.design.shape[1])), np.eye(len(exposure)) / self.pairs.spread**2 + ruled_out

    def update(self, curves: Array, by_channel: Array, shared: Array) -> float:
        """Take the curves and the errors; the weights stay."""
        self.logs = curves
        self.errors = shared
        return 0.0


class _ExposuresByNoise(_Exposures):
    """Exposures, with pairs weighted by the noise of their codes, as the slopes of the last round's curves give it."""

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """The channels share one scale of f⁻¹ at middle grey, within 2 %: pairs leave it to what lies beyond them."""
        middle = basis.at(np.array([0.5]))[1] / SAME_SCALE
        ties = np.kron(np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]), middle)
        return ties, super().prior(basis)[1]

    def update(self, curves: Array, by_channel: Array, shared: Array) -> float:
        """Take the curves and the errors of a round, and the noise by their slopes; the weights stay."""
        super().update(curves, by_channel, shared)
        slopes = np.gradient(curves, np.linspace(0.0, 1.0, len(curves)), axis=0)
        slope_of_first, slope_of_second = _at(self.pairs.first, slopes), _at(self.pairs.second, slopes)
        self.noise = np.maximum(ROUNDING * np.hypot(slope_of_first, slope_of_second), LEAST_NOISE)
        return np.inf


class _RobustExposures(_ExposuresByNoise):
    """Exposures, with pairs weighted by noise and, once curves are known, by their residuals, too."""

    def __init__(self, solved: _ExposuresByNoise) -> None:
        super().__init__(solved.pairs, solved.unsaturated)
        self.noise = solved.noise

    def update(self, curves: Array, by_channel: Array, shared: Array) -> float:
        """Take the solution of a round, and weigh by its residuals; return the mean change of the weights."""
        super().update(curves, by_channel, shared)
        ratio = (self.pairs.log_ratio + self.signs_of_shots @ shared)[:, None]
        fitted_ratio = _at(self.pairs.second, curves) - _at(self.pairs.first, curves)
        residual = np.max(np.abs(fitted_ratio - ratio) / self.noise, axis=1)
        last_weight = self.weight
        self.weight = PAIR_WEIGHTS(residual, residual[self.unsaturated])
        return float(np.mean(np.abs(self.weight - last_weight)))


def _at(encoded: Array, table: Array) -> Array:
    """The values (n, 3) of a table (k, 3) over evenly spaced codes at encoded values (n, 3)."""
    codes = np.linspace(0.0, 1.0, len(table))
    return np.stack([np.interp(encoded[:, c], codes, table[:, c]) for c in range(3)], axis=1)


def _continued_to_white(logs: Array, pairs: ExposurePairs, weight: Array) -> Array:
    """Continue log f⁻¹ (k, 3) above the brightest trusted sample as a power of EMoR's mean, with the slope that it has.

    What the least squares make of codes that no pair reaches depends on the noise alone.
    """
    codes, shape = np.linspace(0.0, 1.0, len(logs)), log_inverse_emor().mean
    continued = logs.copy()
    for channel in range(3):
        top = float(pairs.second[weight > 0.5, channel].max(initial=0.0))
        span = [max(top - SLOPE_SPAN, 0.0), top]
        log_at_low, log_at_top = np.interp(span, codes, logs[:, channel])
        shape_at_low, shape_at_top = np.interp(span, codes, shape)
        power = (log_at_top - log_at_low) / (shape_at_top - shape_at_low)
        beyond = codes > top
        continued[beyond, channel] = log_at_top + power * (shape[beyond] - shape_at_top)
    return continued
