"""Fits a response to a JPEG bracket alone, without RAW (thesis 4.2.1), and simple curves to compare it with.

A fit is believed only where it explains the bracket: better than sRGB's curve does, with exposures near those that are
stated, and with neighbouring shots that agree after linearizing. Otherwise the next start is tried, of another family
of curves or of all colours; where none is left the bracket is refused.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array, Mask
from lutforge.calibration.curve_basis import gamma_response, log_emor_basis, log_spline_basis, srgb_response
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.response_from_exposures import (
    ExposureResponseFit,
    fit_response_by_least_squares,
    fit_response_to_exposures,
)
from lutforge.calibration.response_verdict import ResponseVerdict, judge
from lutforge.colour.saturation import saturation
from lutforge.errors import CalibrationError
from lutforge.model.response import Response
from lutforge.solvers.cross_validation import leave_groups_out, leave_samples_out

FARTHEST_EXPOSURE = 0.5
"""Stops by which a shot may deviate from its stated exposure: no shutter errs by more, but stated times do."""
AGREEMENT = 0.15
"""Stops within which neighbouring shots must agree after linearizing: what an eye sees between two frames."""

TRIED_CURVES = (3, 6, 10, CURVES)
"""Numbers of EMoR's curves that are tried on held-out surfaces."""
SURFACE_FOLDS = 3
"""Parts of the surfaces that are held out in turn."""
NEARLY_LEAST = 1.02
"""The fewest curves are taken whose error on held-out surfaces is below so many times the least."""


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
    """The responses fitted to a bracket.

    curves: the one that is believed first; exposure_error: by shot, true over stated exposure; pairs: their number.
    black, white: (3,) JPEG values below and above which a channel does not follow the exposure. basis_curves: of EMoR,
    as held-out pairs chose; held_out: its median on these, with exposure errors taken out, NaN for too few pairs.
    all_colours: whether saturated ones counted; agreement: the largest deviation, in stops, of two neighbouring shots
    from their ratio of exposures after linearizing. verdict: whether the response is a fixed property, with the
    exposure errors taken out.
    """

    curves: tuple[CurveFit, ...]
    exposure_error: dict[str, float]
    pairs: int
    black: Array
    white: Array
    basis_curves: int
    held_out: float
    all_colours: bool
    agreement: float
    verdict: ResponseVerdict

    @property
    def response(self) -> Response:
        """The camera's response: the curve that is believed."""
        return self.curves[0].response

    @property
    def statements(self) -> tuple[str, str]:
        """The error of the response, and the range of values that it holds for, in words."""
        best, colours = self.curves[0], "all colours" if self.all_colours else "unsaturated colours"
        agreement = f"neighbouring shots agree within {self.agreement:.2f} stops"
        name = f"EMoR with {self.basis_curves} curves" if best.name == "EMoR" else best.name
        unseen = f"; surfaces that it had not seen are predicted to {self.held_out:.1f} codes (median)"
        return (
            f"{name}, from {self.pairs} pairs of patches, {colours}"
            f"{unseen if np.isfinite(self.held_out) else ''}; {agreement}",
            f"JPEG values follow the exposure from {255 * self.black.max():.0f} to {255 * self.white.min():.0f}",
        )


def fit_bracket(pairs: ExposurePairs, beta: float = BETA) -> BracketFit:
    """Fit EMoR (robust, its curves chosen on held-out pairs), a monotone spline, the best gamma and sRGB to a bracket.

    Colours of a saturation below beta count first; where no curve of theirs is believed, all colours do. Raises
    CalibrationError where the pairs do not determine a response, or none explains them.
    """
    reason = ""
    for limit in dict.fromkeys((beta, 1.0)):
        try:
            fit, doubt = _best_fit(pairs, limit)
        except CalibrationError as error:
            if limit == beta:
                raise
            doubt = str(error)
        if not doubt:
            return fit
        reason = reason or doubt
    raise CalibrationError(
        f"{reason}; counting all colours is no better: check the exposure times (--times), set exposure, white balance "
        "and picture style to manual, keep camera and light still, and shoot steps of one stop, five shots or more"
    )


def _best_fit(pairs: ExposurePairs, beta: float) -> tuple[BracketFit, str]:
    """The best fit to colours of a saturation below beta, and why it is not believed, empty where it is."""
    unsaturated = np.maximum(saturation(pairs.first), saturation(pairs.second)) < beta
    basis_curves, held_out = _choose_curves(pairs, unsaturated, beta)
    fits = {
        "EMoR": fit_response_to_exposures(pairs, beta=beta, basis=log_emor_basis(basis_curves)),
        "monotone spline": fit_response_by_least_squares(pairs, beta, log_spline_basis()),
    }
    responses = {name: fit.response for name, fit in fits.items()} | _simple_responses(pairs, unsaturated)
    curves = {name: _curve_fit(name, response, pairs, unsaturated) for name, response in responses.items()}

    doubts = {name: _doubt(pairs, fit, unsaturated, curves["sRGB"]) for name, fit in fits.items()}
    best = next((name for name, (doubt, _) in doubts.items() if not doubt), "EMoR")
    doubt, agreement = doubts[best]
    shot_error = fits[best].shot_error
    fit = BracketFit(
        curves=(curves.pop(best), *curves.values()),
        exposure_error={name: float(np.exp(error)) for name, error in shot_error.items()},
        pairs=len(pairs),
        black=pairs.black,
        white=pairs.white,
        basis_curves=basis_curves,
        held_out=held_out if best == "EMoR" else float("nan"),
        all_colours=beta >= 1.0,
        agreement=agreement,
        verdict=judge(pairs.corrected(shot_error), fits[best].response),
    )
    return fit, doubt


def _simple_responses(pairs: ExposurePairs, unsaturated: Mask) -> dict[str, Response]:
    """The curves that others are compared with: the gamma that explains the pairs best, and sRGB's."""

    def error(gamma: float) -> float:
        return _residual(pairs, gamma_response(gamma), unsaturated)[1]

    gamma = float(minimize_scalar(error, bounds=(0.5, 5), method="bounded").x)
    return {f"gamma {gamma:.2f}": gamma_response(gamma), "sRGB": srgb_response()}


def _curve_fit(name: str, response: Response, pairs: ExposurePairs, unsaturated: Mask) -> CurveFit:
    """A fitted response with its errors, of the file's own values.

    Pairs are of values that are scaled from black … white to 0 … 1, and so is the response that is fitted to them.
    """
    file_values = np.linspace(0.0, 1.0, 1024)[:, None]
    scaled = np.clip((file_values - pairs.black) / (pairs.white - pairs.black), 0.0, 1.0)
    median, rms = _residual(pairs, response, unsaturated)
    return CurveFit(name, Response(response.linearize(scaled)), median, rms)


def _doubt(pairs: ExposurePairs, fit: ExposureResponseFit, unsaturated: Mask, srgb: CurveFit) -> tuple[str, float]:
    """Why a fit is not believed, empty where it is; and how far neighbouring shots disagree, in stops."""
    corrected = pairs.corrected(fit.shot_error)
    agreement = _agreement(corrected, fit.response, unsaturated)
    shot, error = max(fit.shot_error.items(), key=lambda entry: abs(entry[1]))
    error_in_stops = error / np.log(2.0)
    median = _residual(corrected, fit.response, unsaturated)[0]
    if median > max(srgb.median, 1.0):  # a code of rounding is no difference
        return (
            f"no response explains this bracket: the best is {median:.1f} codes off, where sRGB's curve is "
            f"{srgb.median:.1f}"
        ), agreement
    if abs(error_in_stops) > FARTHEST_EXPOSURE:
        return f"{shot}: its exposure seems to be {error_in_stops:+.1f} stops from what is stated", agreement
    if not agreement <= AGREEMENT:
        return f"neighbouring shots disagree by {agreement:.2f} stops after linearizing", agreement
    return "", agreement


def _agreement(pairs: ExposurePairs, response: Response, unsaturated: Mask) -> float:
    """The largest median deviation, in stops, of the light of two neighbouring shots from their exposure ratio."""
    order = np.argsort(pairs.shot_exposure)
    worst = 0.0
    for darker, brighter in pairwise(order):
        rows = (pairs.first_shot == darker) & (pairs.second_shot == brighter)
        if not np.any(rows & unsaturated):
            continue
        chosen = pairs.select(rows & unsaturated)
        first, second = (np.maximum(response.linearize(side), 1e-6) for side in (chosen.first, chosen.second))
        deviations = np.median(np.log(second / first) - chosen.log_ratio[:, None], axis=0) / np.log(2.0)
        worst = max(worst, float(np.abs(deviations).max()))
    return worst


def _choose_curves(pairs: ExposurePairs, unsaturated: Mask, beta: float) -> tuple[int, float]:
    """The fewest curves of EMoR within 2 % of the least error on held-out surfaces, and that error in codes."""
    surfaces = np.unique(pairs.first_row, return_inverse=True)[1].astype(np.str_)
    folds = (
        leave_groups_out(surfaces, SURFACE_FOLDS)
        if len(np.unique(surfaces)) >= SURFACE_FOLDS
        else leave_samples_out(len(pairs), SURFACE_FOLDS)
    )
    errors: dict[int, float] = {}
    for count in TRIED_CURVES:
        residuals = []
        for fold in folds:
            try:
                fit = fit_response_to_exposures(pairs.select(~fold), beta=beta, basis=log_emor_basis(count))
            except CalibrationError:  # the others span too few tones
                return CURVES, float("nan")
            if np.any(fold & unsaturated):
                residuals.append(_codes_off(pairs.corrected(fit.shot_error), fit.response, fold & unsaturated))
        errors[count] = float(np.median(np.abs(np.concatenate(residuals)))) if residuals else float("nan")
    good = [count for count, error in errors.items() if error <= NEARLY_LEAST * min(errors.values())]
    return (good[0], errors[good[0]]) if good else (CURVES, float("nan"))


def _residual(pairs: ExposurePairs, response: Response, rows: Mask) -> tuple[float, float]:
    """The median and the root mean square of I' − f(k' f⁻¹(I)) in codes."""
    codes = _codes_off(pairs, response, rows)
    return float(np.median(np.abs(codes))), float(np.sqrt(np.mean(codes**2)))


def _codes_off(pairs: ExposurePairs, response: Response, rows: Mask) -> Array:
    """The residuals I' − f(k' f⁻¹(I)) (m, 3) of the pairs of a mask (n,), in codes."""
    return np.asarray(255 * (pairs.white - pairs.black) * pairs.select(rows).residuals(response))
