"""The four fits of the studio, by the functions that the command line calls; each gives a camera profile."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.exposure_pairs import pairs_of_samples
from lutforge.calibration.physical.matrix_and_response import fit_matrix_and_response
from lutforge.calibration.physical.physical_model import fit_gamut_maps, fit_stages
from lutforge.calibration.physical.response_from_exposures import fit_response_to_exposures
from lutforge.calibration.physical.white_balance import complete_multipliers, named_white_balances
from lutforge.calibration.shots.falloff import at_the_centre
from lutforge.calibration.style_data import style_data, unclipped
from lutforge.calibration.style_fit import uniform_lattice_errors
from lutforge.colour.srgb import srgb_decode
from lutforge.errors import CalibrationError, LutForgeError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.model.response import Response
from lutforge.model.white_balance import WhiteBalance
from lutforge.pipeline.calibration import calibrate
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.settings import Multipliers, Selector
from lutforge.studio.workspace import FittedModel


def fit_model(
    kind: str,
    samples: SampleSet,
    rows: Mask,
    options: CalibrationOptions,
    stages: CameraProfile | None,
    progress: Progress,
) -> FittedModel:
    """Fit a model to some rows, and evaluate it on all.

    kind: a key of `workspace.MODELS`. stages: the response, matrix and white balances that a gamut map stands between;
    fitted with it where None. A lattice follows the samples themselves. Raises CalibrationError where the rows do not
    determine the model.
    """
    if rows.sum() < 10:
        raise CalibrationError(f"{int(rows.sum())} samples are left to fit; at least 10 are needed: filter less")
    chosen = with_setting_names(samples.select(rows))
    if kind == "rbf" and stages is not None:
        progress("gamut map", 0.0)
        profile = _between(stages, chosen, options)
    elif kind in ("rbf", "lattice"):
        profile = calibrate(chosen, replace(options, model=cast(ModelName, kind)), progress)
    else:
        progress("fitting", 0.0)
        profile = _stages(kind, chosen, options)
    progress("evaluating on all samples", 0.9)
    fitted = replace(evaluate_on(profile, kind, samples), rows=rows)
    if kind == "lattice":
        progress("error of a uniform lattice", 0.95)
        data, _ = style_data(chosen, complete_multipliers(chosen)[0])
        errors = {
            (name, direction): uniform_lattice_errors(style, options, inverse=direction == "linearize")
            for name, style in data.items()
            for direction in ("render", "linearize")
        }
        fitted = replace(fitted, uniform_error=errors)
    return fitted


def _between(stages: CameraProfile, samples: SampleSet, options: CalibrationOptions) -> CameraProfile:
    """The gamut maps of the styles of fitted stages, with their response, matrix and white balances as they are."""
    multipliers = _multipliers(stages, samples)
    usable = unclipped(samples, multipliers) & np.all(np.isfinite(multipliers), axis=1)
    styles = {}
    for name, style in stages.styles.items():
        rows = usable & (samples.style == name)
        if rows.any():
            maps = fit_gamut_maps(
                samples.raw[rows] * multipliers[rows], samples.srgb[rows], samples.shot[rows], stages.matrix,
                style.physical[0].response, tuple(stages.white_balances), preset=options.preset,
            )  # fmt: skip
            styles[name] = PictureStyle(physical=(maps.model,))
    if not styles:
        raise CalibrationError("no sample is left of the styles that the response and matrix were fitted to")
    return replace(stages, styles=styles, options=replace(options, model="rbf").as_json())


def _stages(kind: str, samples: SampleSet, options: CalibrationOptions) -> CameraProfile:
    multipliers, notes = complete_multipliers(samples)
    usable = unclipped(samples, multipliers)
    inside, known = samples.select(usable), np.all(np.isfinite(samples.wb), axis=1)
    matrix = np.eye(3)
    responses: dict[str, Response] = {}
    if kind == "response":
        for name in np.unique(inside.style):
            part = inside.style == name
            try:
                responses[str(name)] = _response(inside.select(part), multipliers[usable][part], options)
            except CalibrationError as error:
                raise CalibrationError(f'style "{name}": {error}') from None
    else:
        stages = fit_stages(inside, multipliers[usable], known[usable], options.preset)
        matrix, multipliers = stages.matrix, multipliers.copy()
        multipliers[usable] = stages.multipliers
        responses = {name: style.response for name, style in stages.styles.items()}
    balances = named_white_balances(samples, multipliers, matrix)
    styles = {name: PictureStyle(physical=(_conventional(f, matrix, balances),)) for name, f in responses.items()}
    shots = tuple(name for name, _ in samples.by_shot())
    return CameraProfile(str(samples.camera[0]), matrix, balances, styles, shots, options.as_json(), notes)


def _response(samples: SampleSet, multipliers: Array, options: CalibrationOptions) -> Response:
    if options.preset == "thesis":
        return fit_response_to_exposures(pairs_of_samples(samples), options.preset).response
    return fit_matrix_and_response(samples.raw * multipliers, samples.srgb).response


def _conventional(response: Response, matrix: Array, balances: dict[str, WhiteBalance]) -> PhysicalModel:
    return PhysicalModel(tuple(balances), matrix, response, identity_gamut_map(), identity_gamut_map())


def evaluate_on(profile: CameraProfile, kind: str, samples: SampleSet) -> FittedModel:
    """What a profile makes of samples; NaN where it does not know their style or white balance."""
    samples = at_the_centre(with_setting_names(samples), profile.falloffs)
    scene, transformed, predicted, linearized = (np.full_like(samples.raw, np.nan) for _ in range(4))
    multipliers = _multipliers(profile, samples)
    setting = np.char.add(np.char.add(samples.style, "/"), samples.white_balance)
    known = np.all(np.isfinite(multipliers), axis=1) & np.isin(samples.style, list(profile.styles))
    if profile.raw_camera:
        known &= np.isin(samples.white_balance, list(profile.white_balances))
    _, group = np.unique(
        np.column_stack([np.unique(setting, return_inverse=True)[1], multipliers]), axis=0, return_inverse=True
    )
    for index in np.unique(group[known]):
        rows = (group == index) & known
        style, balance = str(samples.style[rows][0]), str(samples.white_balance[rows][0])
        r, g, b = multipliers[rows][0].tolist()
        selector = Selector(style, balance if profile.raw_camera else Multipliers((r / g, 1.0, b / g)))
        lattice = kind == "lattice" and profile.styles[style].render is not None
        model: ModelName = "lattice" if lattice else "rbf"
        scene[rows] = samples.raw[rows] @ profile.raw_to_linear_srgb(selector).T
        predicted[rows] = profile.render(selector, model)(samples.raw[rows])
        linearized[rows] = profile.linearize(selector, "linear-srgb", model)(samples.srgb[rows])
        transformed[rows] = predicted[rows]
        if not lattice:
            physical = profile.styles[style].physical
            one = next((one for one in physical if balance in one.white_balances), physical[0])
            balanced = np.clip(samples.raw[rows] * profile.multipliers(selector), 0.0, 1.0)
            transformed[rows] = one.gamut_map(balanced @ one.matrix.T)
    return FittedModel(profile, scene, transformed, predicted, linearized)


def _multipliers(profile: CameraProfile, samples: SampleSet) -> Array:
    """(n, 3): the files' own where they say, else the profile's of that name."""
    multipliers = samples.wb.copy()
    unknown = ~np.all(np.isfinite(multipliers), axis=1)
    for name in np.unique(samples.white_balance[unknown]):
        rows = unknown & (samples.white_balance == name)
        known = profile.white_balances.get(str(name))
        if known is not None:
            multipliers[rows] = known.factors
    return multipliers


@dataclass(frozen=True)
class ResidualRow:
    """RGB distance of a model from the JPEG on the samples that it was fitted to; held_out: on shots left out."""

    model: str
    mean: float
    median: float
    p95: float
    maximum: float
    held_out: float | None


def residuals(fitted: FittedModel, name: str, samples: SampleSet, rows: Mask) -> ResidualRow | None:
    """The figures on some rows; None where the model says nothing of any of them."""
    distance = np.linalg.norm(fitted.predicted[rows] - samples.srgb[rows], axis=1)
    distance = distance[np.isfinite(distance)]
    if len(distance) == 0:
        return None
    middle, high = np.percentile(distance, [50, 95])
    known = [style.errors["render_mean"] for style in fitted.profile.styles.values() if "render_mean" in style.errors]
    held_out = float(np.mean(known)) if known else None
    return ResidualRow(name, float(distance.mean()), float(middle), float(high), float(distance.max()), held_out)


def before(samples: SampleSet) -> FittedModel | None:
    """What there is before any fit: white-balanced RAW through sRGB's own curve; None where a setting is unknown."""
    try:
        multipliers, _ = complete_multipliers(with_setting_names(samples))
    except LutForgeError:
        return None
    codes = np.linspace(0.0, 1.0, 1024)
    curve = srgb_decode(codes)
    response = Response(np.repeat(curve[:, None], 3, axis=1))
    balances = {"any": WhiteBalance((1.0, 1.0, 1.0))}
    model = _conventional(response, np.eye(3), balances)
    profile = CameraProfile(str(samples.camera[0]), np.eye(3), balances, {"any": PictureStyle(physical=(model,))})
    scene = np.clip(samples.raw * multipliers, 0.0, 1.0)
    return FittedModel(profile, scene, scene, response.encode(scene), response.linearize(samples.srgb))
