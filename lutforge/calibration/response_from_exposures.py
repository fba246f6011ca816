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
from lutforge.calibration.robust_fit import Light, robust_fit
from lutforge.model.emor import log_inverse_emor
from lutforge.model.response import Response
from lutforge.solvers.robust_weights import RobustWeights, geman_mcclure

WEIGHTS = RobustWeights(geman_mcclure, multiple=3.0, least=1.0)
ROUNDING = 0.4 / 255
"""Standard deviation of a JPEG value: rounding, and a little noise."""
SAME_SCALE = 0.02
"""Standard deviation of a channel's f⁻¹ at middle grey beside the others', and, to begin with, of log f⁻¹."""


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
    chroma = pairs.saturation
    low = chroma < starting_beta(chroma, beta)
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(low, 2))
    problem = _RobustExposures(pairs, low)
    robust_fit(problem, basis or log_emor_basis(), 12)
    return _response_of(problem)


def fit_response_by_least_squares(
    pairs: ExposurePairs, beta: float = BETA, basis: CurveBasis | None = None
) -> ExposureResponseFit:
    """Fit f by plain least squares to the pairs below a saturation β, which all count alike (thesis 4.2.1, 4.4).

    With a β of infinity no outlier is removed: the conventional way that the thesis compares with (Fig. 4.2, [24]).
    basis, errors: as of `fit_response_to_exposures`.
    """
    low = pairs.saturation < beta
    check_tones(np.concatenate([pairs.first, pairs.second]), np.tile(low, 2))
    problem = _Exposures(pairs, low)
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
    """The problem g(I') − g(I) = log k' + the exposure error of the second shot − that of the first.

    low: (n,) the pairs that count. After the rounds: logs: g (k, 3); errors: (shots,); weight: (n,).
    """

    def __init__(self, pairs: ExposurePairs, low: Mask) -> None:
        self.pairs = pairs
        self.encoded: Array = pairs.second
        self.before: Array | None = pairs.first
        self.weight = low.astype(np.float64)
        self.noise = np.full(pairs.first.shape, SAME_SCALE)
        shots = np.arange(len(pairs.shots))
        self.ends = (pairs.second_shot[:, None] == shots) * 1.0 - (pairs.first_shot[:, None] == shots)

    def light(self) -> Light:
        """The ratio as stated is known; errors of the shots are shared by the channels."""
        known = np.repeat(self.pairs.log_ratio[:, None], 3, axis=1)
        return Light(known, np.zeros((*known.shape, 0)), np.repeat(self.ends[:, None, :], 3, axis=1))

    def precision(self) -> Array:
        """By the noise of the two JPEG values; in (4.4) all pairs count alike."""
        return np.asarray(self.weight[:, None] / self.noise**2)

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """Stated exposures are right within their spread, and do not err by a power.

        A common power of f⁻¹ and of all exposures explains the data as well: errors that grow with the exposure are
        ruled out, so that the exposures as stated fix the power.
        """
        exposure = self.pairs.shot_exposure
        ruled_out = 1e8 * np.outer(exposure, exposure)
        return np.zeros((0, 3 * basis.design.shape[1])), np.eye(len(exposure)) / self.pairs.spread**2 + ruled_out

    def update(self, curves: Array, coefficients: Array, shared: Array) -> float:
        """Take the curves and the errors; the weights stay."""
        self.logs = curves
        self.errors = shared
        return 0.0


class _RobustExposures(_Exposures):
    """The same problem, with pairs weighed by their residuals and by the noise of their codes."""

    def __init__(self, pairs: ExposurePairs, low: Mask) -> None:
        super().__init__(pairs, low)
        self.low = low
        self.rounds = 0

    def prior(self, basis: CurveBasis) -> tuple[Array, Array]:
        """The channels share one scale of f⁻¹ at middle grey, within 2 %: pairs leave it to what lies beyond them."""
        middle = basis.at(np.array([0.5]))[1] / SAME_SCALE
        ties = np.kron(np.array([[1.0, -1.0, 0.0], [0.0, 1.0, -1.0]]), middle)
        return ties, super().prior(basis)[1]

    def update(self, curves: Array, coefficients: Array, shared: Array) -> float:
        """Take the curves and the errors of a round; the weights follow the residuals from the third on."""
        super().update(curves, coefficients, shared)
        self.rounds += 1
        codes = np.linspace(0.0, 1.0, len(curves))
        slopes = np.gradient(curves, codes, axis=0)

        def at(encoded: Array, table: Array) -> Array:
            return np.stack([np.interp(encoded[:, c], codes, table[:, c]) for c in range(3)], axis=1)

        first, second = self.pairs.first, self.pairs.second
        self.noise = np.maximum(ROUNDING * np.hypot(at(first, slopes), at(second, slopes)), 1e-3)
        ratio = (self.pairs.log_ratio + self.ends @ shared)[:, None]
        residual = np.max(np.abs(at(second, curves) - at(first, curves) - ratio) / self.noise, axis=1)
        if self.rounds < 3:
            return np.inf
        before, self.weight = self.weight, WEIGHTS(residual, residual[self.low])
        return float(np.mean(np.abs(self.weight - before)))


def _continued_to_white(logs: Array, pairs: ExposurePairs, weight: Array) -> Array:
    """Continue log f⁻¹ (k, 3) above the brightest trusted sample as a power of EMoR's mean, with the slope that it has.

    What the least squares make of codes that no pair reaches depends on the noise alone.
    """
    codes, shape = np.linspace(0.0, 1.0, len(logs)), log_inverse_emor().mean
    continued = logs.copy()
    for channel in range(3):
        top = float(pairs.second[weight > 0.5, channel].max(initial=0.0))
        low = max(top - 16 / 255, 0.0)  # the span of a slope: a few times the noise of a code
        (lower, upper), (under, over) = (np.interp([low, top], codes, curve) for curve in (logs[:, channel], shape))
        beyond = codes > top
        continued[beyond, channel] = upper + (upper - lower) / (over - under) * (shape[beyond] - over)
    return continued
