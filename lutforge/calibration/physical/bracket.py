"""The response from a JPEG bracket alone, without RAW (thesis 4.2.1), beside plain curves with their residuals."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import minimize_scalar

from lutforge.arrays import Array, Mask
from lutforge.calibration.physical.curve_basis import log_spline_basis
from lutforge.calibration.physical.exposure_pairs import ExposurePairs, pairs_of_bracket
from lutforge.calibration.physical.plain_curves import gamma_response, srgb_response
from lutforge.calibration.physical.response_from_exposures import fit_response_to_exposures
from lutforge.calibration.physical.unsaturated import BETA, saturation
from lutforge.errors import CalibrationError
from lutforge.images.read import read_image
from lutforge.model.response import Response

ENTRIES = 1024


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
    """curves: EMoR's first, then the plain ones. exposure_error: by shot, true over stated exposure. pairs: points.

    black, white: (3,) JPEG values below and above which a channel does not follow the exposure.
    """

    curves: tuple[CurveFit, ...]
    exposure_error: dict[str, float]
    pairs: int
    black: Array
    white: Array

    @property
    def response(self) -> Response:
        """The camera's: EMoR's."""
        return self.curves[0].response


def response_from_bracket(
    paths: Sequence[str | Path], exposure_s: Sequence[float] | None = None, beta: float = BETA
) -> BracketFit:
    """Fit f to photographs of one still scene, from a tripod, that differ in the exposure only.

    exposure_s: relative exposures; None reads time, aperture and ISO from the files. beta: HSV saturation below which
    colours count (1: all, for a scene with nothing near neutral, whose curve then carries what the gamut map did).
    Raises CalibrationError, with what to shoot, where the bracket does not determine a response; ImageError.
    """
    images = [read_image(path) for path in paths]
    names = [Path(path).name for path in paths]
    for name, image in zip(names, images, strict=True):
        if image.pixels.shape[2] < 3:
            raise CalibrationError(f"{name}: a grey image; the response is fitted to red, green and blue")
    if exposure_s is None:
        exposure_s = [_stated_exposure(name, image.spec) for name, image in zip(names, images, strict=True)]
    return fit_bracket(
        pairs_of_bracket(names, [image.pixels[..., :3].astype(np.float64) for image in images], exposure_s), beta
    )


def _stated_exposure(name: str, spec: object) -> float:
    def number(*tags: str) -> float:
        found = (spec.getattribute(tag) for tag in tags)  # type: ignore[attr-defined]  # OpenImageIO has no types
        return float(next((value for value in found if value), 0.0))

    time = number("ExposureTime", "Exif:ExposureTime")
    aperture, iso = number("FNumber", "Exif:FNumber"), number("Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings")
    if time <= 0:
        raise CalibrationError(f"{name}: the file states no exposure time; give the exposures of the bracket")
    return time * (iso or 100.0) / 100.0 / (aperture or 1.0) ** 2


def fit_bracket(pairs: ExposurePairs, beta: float = BETA) -> BracketFit:
    """EMoR (the robust fit), a monotone spline, the best gamma and sRGB, on the exposure pairs of a bracket."""
    fit = fit_response_to_exposures(pairs, beta=beta)
    plain = np.maximum(saturation(pairs.first), saturation(pairs.second)) < beta
    if not plain.any():
        plain = fit.weight > 0.5
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
    errors = {name: float(np.exp(value)) for name, value in fit.shot_error.items()}
    return BracketFit(found, errors, len(pairs), pairs.black, pairs.white)


def _residual(pairs: ExposurePairs, response: Response, rows: Mask) -> tuple[float, float]:
    """Median and root mean square of I' − f(k' f⁻¹(I)) in codes."""
    expected = response.encode(np.exp(pairs.log_ratio[rows])[:, None] * response.linearize(pairs.first[rows]))
    codes = 255.0 * (pairs.white - pairs.black) * (pairs.second[rows] - expected)
    return float(np.median(np.abs(codes))), float(np.sqrt(np.mean(codes**2)))


def _over_codes(response: Response, pairs: ExposurePairs) -> Response:
    """The response of values scaled from black … white, as one of the file's own values 0 … 1."""
    codes = np.linspace(0.0, 1.0, ENTRIES)[:, None]
    return Response(response.linearize(np.clip((codes - pairs.black) / (pairs.white - pairs.black), 0.0, 1.0)))
