"""Fits a response to a JPEG bracket alone, without RAW (thesis 4.2.1), and simple curves to compare it with."""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.brightness_transfer import ResponseVerdict, judge
from lutforge.calibration.physical.curve_basis import log_emor_basis, log_spline_basis
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.calibration.physical.plain_curves import gamma_response, srgb_response
from lutforge.calibration.physical.response_from_exposures import fit_response_to_exposures
from lutforge.calibration.physical.unsaturated import BETA, saturation
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.solvers.cross_validation import leave_groups_out, leave_samples_out


@dataclass(frozen=True, eq=False)
class CurveFit:
    """One model of f. name: "EMoR", "monotone spline", "gamma 2.2", "sRGB".

    median, rms: of I' − f(k' f⁻¹(I)) over the pairs of unsaturated colours, in codes of 255, with exposures as stated.
    """

    name: str
    response: Response
    median: float
    rms: float


@dataclass(frozen=True, eq=False)
class BracketFit:
    """The responses fitted to a bracket. curves: EMoR's first, then the plain ones; pairs: the number of points.

    exposure_error: by shot, true over stated exposure.

    black, white: (3,) JPEG values below and above which a channel does not follow the exposure. basis_curves: of EMoR,
    as held-out pairs chose; held_out: EMoR's median on these, with exposure errors taken out, NaN for too few pairs.
    verdict: whether the response is a fixed property, with the exposure errors taken out.
    """

    curves: tuple[CurveFit, ...]
    exposure_error: dict[str, float]
    pairs: int
    black: Array
    white: Array
    basis_curves: int
    held_out: float
    verdict: ResponseVerdict

    @property
    def response(self) -> Response:
        """The camera's response: the EMoR curve."""
        return self.curves[0].response

    @property
    def told(self) -> tuple[str, str]:
        """The error of the response, and the range of values that it holds for, in words."""
        return (
            f"EMoR with {self.basis_curves} curves, from {self.pairs} pairs of patches; pairs of shots that it had not "
            f"seen are predicted to {self.held_out:.1f} codes (median)",
            f"JPEG values follow the exposure from {255 * self.black.max():.0f} to {255 * self.white.min():.0f}",
        )


def fit_bracket(pairs: ExposurePairs, beta: float = BETA) -> BracketFit:
    """Fit EMoR (robust, its curves chosen on held-out pairs), a monotone spline, the best gamma and sRGB to a bracket.

    Raises CalibrationError where the pairs do not determine a response.
    """
    plain = np.maximum(saturation(pairs.first), saturation(pairs.second)) < beta
    count, held_out = _choose_curves(pairs, plain, beta)
    fit = fit_response_to_exposures(pairs, beta=beta, basis=log_emor_basis(count))
    gamma = minimize_scalar(
        lambda value: _residual(pairs, gamma_response(value), plain)[1], bounds=(0.5, 5.0), method="bounded"
    ).x
    curves = {
        "EMoR": fit.response,
        "monotone spline": fit_response_to_exposures(pairs, "thesis", beta, log_spline_basis()).response,
        f"gamma {gamma:.2f}": gamma_response(float(gamma)),
        "sRGB": srgb_response(),
    }
    found = tuple(
        CurveFit(name, _over_codes(curve, pairs), *_residual(pairs, curve, plain)) for name, curve in curves.items()
    )
    return BracketFit(
        found,
        {name: float(np.exp(value)) for name, value in fit.shot_error.items()},
        len(pairs),
        pairs.black,
        pairs.white,
        count,
        held_out,
        judge(pairs.corrected(fit.shot_error), fit.response),
    )


def _choose_curves(pairs: ExposurePairs, plain: Mask, beta: float) -> tuple[int, float]:
    """The fewest curves of EMoR within 2 % of the least error on held-out pairs of shots, and that error in codes."""
    shots = np.char.add(pairs.first_shot.astype(np.str_), np.char.add("-", pairs.second_shot.astype(np.str_)))
    folds = leave_groups_out(shots, 3) if len(np.unique(shots)) >= 3 else leave_samples_out(len(pairs), 3)
    errors: dict[int, float] = {}
    every = 15  # as many as there are
    for count in (3, 6, 10, every):
        parts = []
        for held in folds:
            try:
                fit = fit_response_to_exposures(pairs.select(~held), beta=beta, basis=log_emor_basis(count))
            except CalibrationError:  # the others span too few tones
                return every, float("nan")
            if np.any(held & plain):
                parts.append(_codes_off(pairs.corrected(fit.shot_error), fit.response, held & plain))
        errors[count] = float(np.median(np.abs(np.concatenate(parts)))) if parts else float("nan")
    good = [count for count, error in errors.items() if error <= 1.02 * min(errors.values())]
    return (good[0], errors[good[0]]) if good else (every, float("nan"))


def _residual(pairs: ExposurePairs, response: Response, rows: Mask) -> tuple[float, float]:
    """Median and root mean square of I' − f(k' f⁻¹(I)) in codes."""
    codes = _codes_off(pairs, response, rows)
    return float(np.median(np.abs(codes))), float(np.sqrt(np.mean(codes**2)))


def _codes_off(pairs: ExposurePairs, response: Response, rows: Mask) -> Array:
    """I' − f(k' f⁻¹(I)) (m, 3) of some rows, in codes."""
    return np.asarray(255.0 * (pairs.white - pairs.black) * pairs.select(rows).departure(response))


def _over_codes(response: Response, pairs: ExposurePairs) -> Response:
    """The response of values scaled from black … white, as one of the file's own values 0 … 1."""
    codes = np.linspace(0.0, 1.0, 1024)[:, None]
    return Response(response.linearize(np.clip((codes - pairs.black) / (pairs.white - pairs.black), 0.0, 1.0)))
