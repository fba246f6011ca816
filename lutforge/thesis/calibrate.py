"""From samples to a camera profile by the thesis: its stages and gamut maps (4.2), and its lattices (5.3)."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.calibrate import assembled, matrix_of
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.coverage_notes import thin_settings
from lutforge.calibration.fit_styles import fit_styles, notes_on_fits
from lutforge.calibration.lattice.monochrome import inverse_of_greys
from lutforge.calibration.steps import (
    Step,
    complete_white_balances,
    diagnose,
    drop_small_styles,
    fit_gains,
    note_given_stages,
    reference_raw_by,
)
from lutforge.calibration.style import StyleData, style_data
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.lattice import Lattice
from lutforge.model.profile import ByDirection, CameraModel, PictureStyle
from lutforge.model.response import Response
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.thesis.camera_model import CameraStages, fit_gamut_maps, fit_stages
from lutforge.thesis.lattice import fit_thesis
from lutforge.thesis.options import ThesisOptions
from lutforge.thesis.reference_camera import own_raw
from lutforge.threads import each, one_blas_thread


def thesis_steps(options: ThesisOptions) -> tuple[Step, ...]:
    """The steps that prepare the samples. The thesis corrects no vignetting, and leaves no shot out."""

    def use_reference_raw(state: CalibrationState) -> CalibrationState:
        return reference_raw_by(state, lambda reference: own_raw(reference, options))

    return (
        use_reference_raw,
        complete_white_balances,
        drop_small_styles,
        note_given_stages,
        diagnose,
        fit_gains,
    )


@one_blas_thread
def calibrate(
    samples: SampleSet,
    options: ThesisOptions | None = None,
    progress: Progress = silent,
    given: CameraProfile | None = None,
) -> tuple[CameraProfile, dict[str, StyleData]]:
    """Fit f, Ts, Tw and, per style, h and h⁻¹, and the lattices of both directions.

    given: a profile whose responses, matrix and white balances are taken as they are (`calibrate_base`). Where no
    exposure pairs determine f, the profile holds the lattices alone, with a note. Returns a profile without held-out
    errors, and by style the data that these are measured with. Raises CalibrationError where the samples do not
    determine a lattice.
    """
    options = options or ThesisOptions()
    progress("checking white balances and shots", 0.0)
    state = prepared(samples, options, given)
    notes = thin_settings(state.samples)

    progress("response, matrix and white balances", 0.0)
    models: Mapping[str, CameraModel] = {}
    matrix = None if given is None else given.matrix
    try:
        stages, usable = stages_of(given, state) if given is not None else fit_camera_stages(state, options)
        state = replace(state, multipliers=stages.multipliers)
        models = camera_models(stages, state, usable, options)
        matrix = stages.matrix if matrix is None else matrix
    except CalibrationError as error:
        notes.append(f"the profile holds lattices alone, no camera model: {error}")

    data, clipped = style_data(state.samples, state.multipliers, given_bases=state.given_bases)

    def models_of(name: str) -> tuple[CameraModel, ...]:
        return (models[name],) if name in models else ()

    styles = fit_styles(data, models_of, lambda style: fit_lattices(style, options), progress)

    matrix = matrix_of(data) if matrix is None else matrix
    if given is None:
        matrix = matrix / matrix.sum(axis=1, keepdims=True)
    notes += notes_on_fits(data, clipped, len(state.samples))
    return assembled(state, matrix, styles, options.as_json(), notes), data


@one_blas_thread
def calibrate_base(
    samples: SampleSet, options: ThesisOptions | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit f, Ts and Tw alone: a profile whose gamut maps change nothing. Raises CalibrationError."""
    options = options or ThesisOptions()
    progress("response, matrix and white balances", 0.0)
    state = prepared(samples, options)
    stages, _ = fit_camera_stages(state, options)
    progress("done", 1.0)

    balances = tuple(str(name) for name in np.unique(state.samples.white_balance))
    styles = {
        name: PictureStyle(models=(CameraModel.without_gamut_map(balances, stages.matrix, response),))
        for name, response in stages.responses.items()
    }
    matrix = stages.matrix / stages.matrix.sum(axis=1, keepdims=True)
    return assembled(replace(state, multipliers=stages.multipliers), matrix, styles, options.as_json())


def prepared(samples: SampleSet, options: ThesisOptions, given: CameraProfile | None = None) -> CalibrationState:
    """The state after all steps. Raises CalibrationError."""
    state = CalibrationState(samples, samples.wb, options.beta, options.curves, given)
    for step in thesis_steps(options):
        state = step(state)
    return state


def fit_lattices(data: StyleData, options: ThesisOptions) -> ByDirection[Lattice]:
    """The lattices of both directions of a style. Raises CalibrationError.

    A black-and-white style is linearized by the inverse of the greys of its rendering.
    """
    balanced = data.balanced
    encoded = data.encoded
    if data.monochrome:
        render = fit_thesis(balanced, encoded, options, clips=True)
        return ByDirection(render, inverse_of_greys(render, options))
    directions = ((balanced, encoded, True), (encoded, balanced, False))
    return ByDirection(*each(lambda sides: fit_thesis(sides[0], sides[1], options, clips=sides[2]), directions))


def fit_camera_model(data: StyleData, options: ThesisOptions) -> CameraModel:
    """Fit the camera model of one style to its samples alone. Raises CalibrationError."""
    if data.given is not None:
        matrix = data.given.matrix
        response = data.given.response
    else:
        known = np.ones(len(data.shot), dtype=np.bool_)
        stages = fit_stages(data.samples, data.balanced / data.samples.raw, known, options)
        matrix = stages.matrix
        response = next(iter(stages.responses.values()))
    balances = tuple(str(name) for name in np.unique(data.samples.white_balance))
    return fit_gamut_maps(data.balanced, data.encoded, data.shot, matrix, response, balances, options)


def fit_camera_stages(state: CalibrationState, options: ThesisOptions) -> tuple[CameraStages, Mask]:
    """Fit f of every style, Ts and the unknown Tw; black-and-white styles are left out.

    Returns the stages for all samples, and which (n,) a gamut map can be fitted to. Raises CalibrationError.
    """
    samples = state.samples
    multipliers = state.multipliers
    monochrome = [name for name, style in style_data(samples, multipliers)[0].items() if style.monochrome]
    usable = state.unclipped & ~np.isin(samples.style, monochrome)
    if not usable.any():
        raise CalibrationError(
            f'style "{monochrome[0]}" is black and white: its JPEGs hold no colour to fit a camera model to: '
            "add shots in another style"
        )
    known = np.all(np.isfinite(samples.wb), axis=1)
    stages = fit_stages(samples.select(usable), multipliers[usable], known[usable], options)

    completed = multipliers.copy()
    completed[usable] = stages.multipliers
    for setting in np.unique(samples.settings[~known]):
        rows = ~known & (samples.settings == setting)
        if (rows & usable).any():
            completed[rows] = completed[rows & usable][0]
    return replace(stages, multipliers=completed), usable


def stages_of(profile: CameraProfile, state: CalibrationState) -> tuple[CameraStages, Mask]:
    """The stages of a profile for the samples of a state. Raises CalibrationError where it has none of their styles."""
    models = {name: style.models[0] for name, style in profile.styles.items() if style.models}
    responses: Mapping[str, Response] = {name: model.response for name, model in models.items()}
    usable = state.unclipped & np.isin(state.samples.style, list(responses))
    if not usable.any():
        raise CalibrationError(
            f"the given response and matrix are of the styles {', '.join(responses) or 'none'}; the samples are of "
            f"{', '.join(np.unique(state.samples.style))}"
        )
    return CameraStages(next(iter(models.values())).matrix, state.multipliers, responses), usable


def camera_models(
    stages: CameraStages, state: CalibrationState, usable: Mask, options: ThesisOptions
) -> dict[str, CameraModel]:
    """Fit h and h⁻¹ of each style that has usable samples (n,). Raises CalibrationError."""
    samples = state.samples
    models = {}
    balances = tuple(str(name) for name in np.unique(samples.white_balance))
    for name, response in stages.responses.items():
        rows = usable & (samples.style == name)
        if rows.any():
            balanced: Array = samples.raw[rows] * stages.multipliers[rows]
            models[name] = fit_gamut_maps(
                balanced, samples.srgb[rows], samples.shot[rows], stages.matrix, response, balances, options
            )
    return models
