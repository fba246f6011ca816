"""Cameras without RAW: a reference camera's RAW of the same scene stands in (thesis 4.2.4, equations 4.9, 4.10)."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.matrix import LEAST_CONDITION, hue_spread
from lutforge.calibration.physical.matrix_and_response import (
    MatrixAndResponse,
    encoded_residual,
    encoding_slope,
    fit_matrix_and_response,
    matrix_between,
)
from lutforge.calibration.physical.physical_model import (
    fit_shared_gamut_maps,
    response_of_exposures,
    robust_options,
)
from lutforge.calibration.physical.unsaturated import BETA, saturation, untouched_odds
from lutforge.calibration.physical.white_balance import complete_multipliers, with_fitted_gains
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.clipping import unclipped_colours
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.robust_weights import RobustWeights, cauchy

ROBUST = RobustWeights(cauchy, multiple=2.0, least=1.0 / 255.0)
LEAST_COLOURS = 12
MOST_RESIDUAL = 0.08
"""Median error of the trusted colours through f and Tz, 1 = full scale, above which no fixed rendering explains them:
the chart cameras have 0.002 … 0.03; shots that do not belong together have more."""


def fit_reference_matrix(fit: MatrixAndResponse, x: Array, encoded: Array) -> Array:
    """Ts Tc (3, 3) of one white balance, rows sum to 1, with f as fitted over all of them (4.10).

    x: the reference camera's RAW, balanced so that neutrals are neutral (n, 3). Raises CalibrationError where
    the colours do not determine it, or contradict every matrix.
    """
    linear, slope = fit.response.linearize(encoded), encoding_slope(fit.response, encoded)
    for beta in (BETA, 0.4, 0.5, 0.7):  # on a small chart hardly any unsaturated colour is not grey
        trust = untouched_odds(saturation(encoded), beta)
        sure = trust >= 0.5
        if sure.sum() >= LEAST_COLOURS and hue_spread(linear[sure]) >= LEAST_CONDITION:
            break
    if sure.sum() < LEAST_COLOURS or hue_spread(linear[sure]) < LEAST_CONDITION:
        raise CalibrationError(
            f"{int(sure.sum())} unsaturated colours, and {LEAST_COLOURS} of several hues are needed: "
            "shoot a colour chart with both cameras"
        )
    matrix = fit.matrix
    for _ in range(10):
        residual = encoded_residual(fit.response, matrix, x, encoded)
        matrix = matrix_between(x, linear, trust * ROBUST(residual, residual[sure]), slope)
    error = float(np.median(encoded_residual(fit.response, matrix, x, encoded)[sure]))
    if error > MOST_RESIDUAL or np.linalg.cond(matrix) > 30.0:
        raise CalibrationError(
            f"no matrix takes the reference camera's RAW to these JPEGs (median error {255 * error:.0f} codes): "
            "were both taken of the same scene, in the same order, in manual mode?"
        )
    return matrix


def calibrate_by_reference(
    samples: SampleSet,
    options: CalibrationOptions,
    progress: Callable[[str, float], None],
    stages: CameraProfile | None = None,
    gamut_maps: bool = True,
) -> CameraProfile:
    """A profile of a camera without RAW: per style f from exposure pairs, per white balance Tz, h and h⁻¹ over all.

    samples: `raw` holds the reference camera's values of the same patches. Refinishing works on such a profile;
    linearize to the camera's own RAW does not. stages: a profile whose f and Tz are taken; gamut_maps:
    whether h and h⁻¹ are fitted. Raises CalibrationError, in one line with what to shoot.
    """
    inside = samples.select(unclipped_colours(samples.srgb, samples.raw))
    if len(inside) < LEAST_COLOURS:
        raise CalibrationError(
            f"{len(inside)} samples are unclipped in both the JPEG and the reference camera's RAW: expose less"
        )
    styles: dict[str, PictureStyle] = {}
    for index, name in enumerate(np.unique(inside.style)):
        progress(f"{name}: fitting", index / len(np.unique(inside.style)))
        own = inside.select(inside.style == name)
        given = stages.styles[str(name)].physical if stages is not None and name in stages.styles else ()
        models = given or _without_gamut_maps(own, str(name), options)
        styles[str(name)] = PictureStyle(physical=_with_gamut_maps(models, own, options) if gamut_maps else models)
    progress("done", 1.0)
    names = [str(name) for name in np.unique(inside.white_balance)]
    return CameraProfile(
        camera=str(samples.camera[0]),
        matrix=np.eye(3),
        white_balances={name: WhiteBalance((1.0, 1.0, 1.0)) for name in names},
        styles=styles,
        shots=tuple(name for name, _ in inside.by_shot()),
        options={**options.as_json(), "model": "rbf"},
        notes=(f"RAW of {samples.raw_camera[0]} stands in: refinishing works, linearizing to the own RAW cannot",),
        raw_camera=str(samples.raw_camera[0]),
    )


def _without_gamut_maps(samples: SampleSet, name: str, options: CalibrationOptions) -> tuple[PhysicalModel, ...]:
    """One physical model a white balance; they share f. h and h⁻¹ change nothing."""
    blind = replace(samples, wb=np.full_like(samples.wb, np.nan))  # the file's are of the camera, not of the reference
    multipliers = complete_multipliers(blind)[0]
    multipliers = with_fitted_gains(samples, multipliers, np.ones(len(samples), dtype=np.bool_))
    x = samples.raw * multipliers
    fit = fit_matrix_and_response(x, samples.srgb, options=robust_options(options.physical))
    if options.preset == "thesis":
        response = response_of_exposures(samples, options.preset, options.physical)
        fit = replace(fit, response=_scaled(response, fit))
    models, none = [], identity_gamut_map()
    for balance in np.unique(samples.white_balance):
        rows = samples.white_balance == balance
        try:
            own = fit_reference_matrix(fit, x[rows], samples.srgb[rows])
        except CalibrationError as error:
            raise CalibrationError(f'style "{name}", white balance "{balance}": {error}') from None
        matrix = own * np.median(multipliers[rows], axis=0)
        models.append(PhysicalModel((str(balance),), matrix, fit.response, none, none))
    return tuple(models)


def _with_gamut_maps(
    models: tuple[PhysicalModel, ...], samples: SampleSet, options: CalibrationOptions
) -> tuple[PhysicalModel, ...]:
    """The models with h and h⁻¹, which they share, fitted to the samples of their white balances."""
    mixed = np.full_like(samples.raw, np.nan)
    for model in models:
        rows = np.isin(samples.white_balance, model.white_balances)
        mixed[rows] = samples.raw[rows] @ model.matrix.T
    known, nugget = np.isfinite(mixed[:, 0]), options.physical.nugget
    forward, back = fit_shared_gamut_maps(
        mixed[known], samples.srgb[known], samples.shot[known], models[0].response, (nugget, nugget), options.preset,
        options.physical.centres,
    )  # fmt: skip
    return tuple(replace(model, gamut_map=forward.gamut_map, inverse_gamut_map=back.gamut_map) for model in models)


def _scaled(response: Response, fit: MatrixAndResponse) -> Response:
    """f⁻¹ of exposure pairs, which leave its scale open, with the scale that RAW gives at middle grey."""
    grey = np.full((1, 3), 0.5)
    return Response(response.inverse * (fit.response.linearize(grey) / response.linearize(grey)))
