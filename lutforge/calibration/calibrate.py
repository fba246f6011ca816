"""From samples to a camera profile: the steps that prepare the samples, then the fit of each style."""

from collections.abc import Iterable, Mapping
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.coverage_notes import thin_settings
from lutforge.calibration.fit_styles import fit_styles, notes_on_fits
from lutforge.calibration.named_white_balances import colorimetric_matrix, named_white_balances
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.steps import (
    Step,
    complete_white_balances,
    correct_local_changes,
    correct_vignetting,
    diagnose,
    drop_outlier_shots,
    drop_small_styles,
    fit_gains,
    note_dark_end,
    note_given_stages,
    use_reference_raw,
)
from lutforge.calibration.style import StyleData, fit_lattices, style_data
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import CameraModel, PictureStyle
from lutforge.model.provenance import OwnRaw
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.threads import one_blas_thread

STEPS: tuple[Step, ...] = (
    use_reference_raw,
    complete_white_balances,
    drop_small_styles,
    note_given_stages,
    correct_vignetting,
    correct_local_changes,
    diagnose,
    fit_gains,
    drop_outlier_shots,
    note_dark_end,
)


@one_blas_thread
def calibrate(
    samples: SampleSet,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    given: CameraProfile | None = None,
) -> tuple[CameraProfile, dict[str, StyleData]]:
    """Fit the white balances, the matrix and, per style, the camera model and the lattices that are its fast form.

    given: a profile whose responses, matrices and white balances are taken as they are (`calibrate_base`). Returns a
    profile without held-out errors, and by style the data that these are measured with. Raises CalibrationError, in one
    line with what to do, where the samples do not determine the models.
    """
    options = options or CalibrationOptions()
    progress("checking white balances and shots", 0.0)
    state = prepared(samples, options, given)

    data, clipped = style_data(state.samples, state.multipliers, options, state.given_bases)
    for name, style in data.items():
        if style.given is None and not style.monochrome:
            data[name] = replace(style, fitted=state.base_of_unsaturated(name))

    def models_of(name: str) -> tuple[CameraModel, ...]:
        return () if data[name].monochrome else (data[name].model,)

    styles = fit_styles(data, models_of, lambda style: fit_lattices(style, options), progress)
    matrix = matrix_of(data) if given is None else given.matrix
    notes = [*thin_settings(state.samples), *notes_on_fits(data, clipped, len(state.samples))]
    return assembled(state, matrix, styles, options.as_json(), notes), data


@one_blas_thread
def calibrate_base(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit the responses, the matrices and the white balances alone: a profile whose gamut maps change nothing.

    Raises CalibrationError where the samples do not determine them.
    """
    options = options or CalibrationOptions()
    progress("response, matrix and white balances", 0.0)
    state = prepared(samples, options)
    bases = {style: state.base_of_unsaturated(style) for style in state.coloured_styles}
    progress("done", 1.0)

    balances = tuple(str(name) for name in np.unique(state.samples.white_balance))
    styles = {
        name: PictureStyle(models=(CameraModel.without_gamut_map(balances, base.matrix, base.response),))
        for name, base in bases.items()
    }
    largest = max(bases, key=lambda name: int(state.rows(name).sum()), default="")
    matrix = bases[largest].matrix if bases else np.eye(3)
    return assembled(state, matrix, styles, options.as_json())


def prepared(samples: SampleSet, options: CalibrationOptions, given: CameraProfile | None = None) -> CalibrationState:
    """The state after all steps. Raises CalibrationError."""
    state = CalibrationState(samples, samples.wb, options.beta, options.curves, given)
    for step in STEPS:
        state = step(state)
    return state


def matrix_of(data: Mapping[str, StyleData]) -> Array:
    """Ts of the style with most samples, rows that sum to 1; the identity where all styles are black and white."""
    coloured = [style for style in data.values() if not style.monochrome]
    if not coloured:
        return np.eye(3)
    matrix = max(coloured, key=lambda style: len(style.shot)).base_of_unsaturated.matrix
    return np.asarray(matrix / matrix.sum(axis=1, keepdims=True))


def assembled(
    state: CalibrationState,
    matrix: Array,
    styles: Mapping[str, PictureStyle],
    options: Mapping[str, object],
    notes: Iterable[str] = (),
) -> CameraProfile:
    """The profile of what was fitted to the prepared samples. notes: what the fits add."""
    balances = named_white_balances(state.samples, state.multipliers, matrix)
    computed = [name for name in balances if name not in state.samples.white_balance]
    colorimetric = colorimetric_matrix(state.samples)
    by = (
        "the camera's matrix"
        if colorimetric is not None
        else "the fitted matrix, which takes warm light for less warm than it is"
    )
    by_matrix = f"white balances {', '.join(computed)} are computed by {by}: no shot was taken with them"
    return CameraProfile(
        camera=str(state.samples.camera[0]),
        matrix=matrix,
        white_balances=balances,
        styles=styles,
        shots=tuple(name for name, _ in state.samples.by_shot()),
        options=options,
        notes=(*state.notes, *notes, *([by_matrix] if computed else [])),
        provenance=state.provenance,
        dng_camera=_dng_camera(state.samples) if isinstance(state.provenance, OwnRaw) else "",
        vignettings=state.vignettings,
        diagnoses=state.diagnoses,
        from_xyz=colorimetric,
    )


def _dng_camera(samples: SampleSet) -> str:
    """The UniqueCameraModel that all DNG files among the shots state; "" where there is none, or they disagree."""
    stated = np.unique(samples.dng_camera[samples.dng_camera != ""])
    return str(stated[0]) if len(stated) == 1 else ""
