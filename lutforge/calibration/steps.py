"""The steps that prepare samples for the fit of each style: functions of a state, each with its own condition and note.

A step takes the state that the one before it returned, and returns it as it is or with other samples, white balances or
notes. Matrix and response of a style, its base, are fitted when a step first asks for them, and handed on until a step
changes the samples that they were fitted to.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.calibration_state import CalibrationState
from lutforge.calibration.checks import NOT_ONE_CAMERA, diagnoses_of
from lutforge.calibration.dark_greys import dark_end_notes
from lutforge.calibration.local_changes import LOCAL_CHANGES, find_local_changes, without_field
from lutforge.calibration.matrix_and_response import LEAST_SAMPLES
from lutforge.calibration.reference_camera import own_raw
from lutforge.calibration.setting_gains import gains_of, multiplied_by_gains, refined_gains
from lutforge.calibration.shot_comparison import ShotCheck, check_shots
from lutforge.calibration.style import styles_with_enough
from lutforge.calibration.vignetting import at_the_centre, fit_vignettings
from lutforge.calibration.white_balance import complete_multipliers, fill_in_known_multipliers
from lutforge.errors import CalibrationError
from lutforge.model.provenance import ReferenceRaw
from lutforge.model.reference_raw import with_own_raw
from lutforge.samples.sample_set import SampleSet

Step = Callable[[CalibrationState], CalibrationState]

GAIN_ROUNDS = 6
"""Rounds of gains, at most."""


def use_reference_raw(state: CalibrationState) -> CalibrationState:
    """Transform a reference camera's RAW to the camera's own (4.9), where the samples hold such RAW."""
    return reference_raw_by(state, lambda samples: own_raw(samples, state.beta, state.curves))


def reference_raw_by(
    state: CalibrationState, transform: Callable[[SampleSet], tuple[SampleSet, Array]]
) -> CalibrationState:
    """Transform a reference camera's RAW by a function that returns the samples and Tc, or by a given profile's Tc."""
    samples = state.samples
    check_one_camera(samples)
    if np.all(samples.raw_camera == samples.camera):
        return state

    raw_camera = str(samples.raw_camera[0])
    if state.given is not None and isinstance(state.given.provenance, ReferenceRaw):
        transformed, transfer = with_own_raw(state.given, samples), state.given.provenance.transfer
    else:
        transformed, transfer = transform(samples)
    check_one_camera(transformed)
    notes = [f"RAW of {raw_camera} replaces the camera's: refinishing works, linearizing to the own RAW cannot"]
    if len(transformed) < len(samples):
        lost = len(samples) - len(transformed)
        notes.append(f"{lost} of {len(samples)} samples are clipped, in the JPEG or in that RAW")
    with_camera_raw = replace(state, samples=transformed, multipliers=transformed.wb, notes=(*state.notes, *notes))
    return replace(with_camera_raw, provenance=ReferenceRaw(raw_camera, transfer))


def complete_white_balances(state: CalibrationState) -> CalibrationState:
    """Estimate the multipliers that the files do not state, or take them from a given profile."""
    samples = state.samples
    if state.given is not None:
        samples = fill_in_known_multipliers(samples, state.given.white_balances)
    multipliers, notes = complete_multipliers(samples)
    return state.with_samples(samples, multipliers, notes)


def drop_small_styles(state: CalibrationState) -> CalibrationState:
    """Leave out the styles with too few samples, each with a note. Raises CalibrationError where no style remains."""
    enough, notes = styles_with_enough(state.samples, state.multipliers)
    return state.select(enough, notes)


def note_given_stages(state: CalibrationState) -> CalibrationState:
    """Note that a given profile's responses and matrices hold as they are, where there is one."""
    if state.given is None:
        return state
    note = "response and matrix were given: the held-out errors take them as they are"
    return replace(state, notes=(*state.notes, note))


def correct_vignetting(state: CalibrationState) -> CalibrationState:
    """Remove from the RAW the vignetting that the camera corrects in its JPEGs only, where it is significant."""
    vignettings = fit_vignettings(state.samples, state.multipliers, state.unclipped)
    if not vignettings:
        return state
    centred = at_the_centre(state.samples, vignettings)
    corrected = state.with_samples(centred, state.multipliers, (vignetting.note for vignetting in vignettings))
    return replace(corrected, vignettings=vignettings)


def correct_local_changes(state: CalibrationState) -> CalibrationState:
    """Remove the field of light that RAW and JPEG of nearly all shots differ by, and find shots changed in a part.

    Few of these are left out; of many it is not known whether the others are right, and only the cause is named.
    """
    found = find_local_changes(state.samples, state.multipliers, state.unclipped)
    if found.field is not None:
        state = state.with_samples(without_field(state.samples, found.field), state.multipliers)
    if found.changes and not found.are_few:
        return replace(state, notes=(*state.notes, *found.notes), diagnoses=(found.diagnosis,))

    changed = [change.shot for change in found.changes]
    return state.select(~np.isin(state.samples.shot, changed), found.notes) if changed or found.notes else state


def _differs_by_place(state: CalibrationState) -> bool:
    """True where RAW and JPEG are known to differ by place, from which all else may result that is found."""
    return any(known.cause == LOCAL_CHANGES for known in state.diagnoses)


def diagnose(state: CalibrationState) -> CalibrationState:
    """Recognize samples that no camera makes, and what made them so."""
    if _differs_by_place(state):
        return state
    of_all = state.bases_of_all_colours()
    of_unsaturated = {style: state.base_of_unsaturated(style) for style in of_all}
    return replace(state, diagnoses=diagnoses_of(state.samples, state.multipliers, of_all, of_unsaturated))


def fit_gains(state: CalibrationState) -> CalibrationState:
    """Fit the common factor that a setting has besides its multipliers, or take a given profile's.

    Each round compares the settings by a base that is fitted with the gains of the round before, first without any:
    where settings have few tones in common, gains that were fitted with the response would trade with it.
    """
    samples, multipliers = state.samples, state.multipliers
    if state.given is not None:
        given_gains = gains_of(state.given.white_balances)
        return state.with_samples(samples, multiplied_by_gains(samples, multipliers, given_gains))

    gains = {str(name): 1.0 for name in np.unique(samples.white_balance[state.unclipped]) if name != "auto"}
    for _ in range(GAIN_ROUNDS if len(gains) > 1 else 0):
        bases = {style: state.base_of_unsaturated(style) for style in state.styles}
        refined = refined_gains(samples, state.multipliers, state.unclipped, bases, gains)
        if refined == gains:
            break
        gains = refined
        state = state.with_samples(samples, multiplied_by_gains(samples, multipliers, gains))
    return state


def drop_outlier_shots(state: CalibrationState) -> CalibrationState:
    """Leave out the shots that deviate from the others of their style, and name two groups of shots.

    Of two groups no shot is left out, since it is not known which are right; they take the place of other diagnoses.
    Where a cause spoils the whole set, so that each group shows it, no shot is at fault, and only the cause is named.
    """
    if _differs_by_place(state):
        return state
    comparison = check_shots(state.samples, state.multipliers, state.unclipped, state.bases_of_all_colours())
    spoiling = _causes_of_all_groups(state, comparison)
    if spoiling:
        return replace(state, diagnoses=tuple(known for known in state.diagnoses if known.cause in spoiling))

    if comparison.deviations:
        state = _without_outliers(state, comparison)
    if comparison.groups:
        return replace(state, diagnoses=tuple(groups.diagnosis for groups in comparison.groups))
    return state


def _without_outliers(state: CalibrationState, comparison: ShotCheck) -> CalibrationState:
    """The state without the shots that deviate.

    It is diagnosed anew where it was found to be spoilt, since the shots that agree may look like one camera's.
    """
    outliers = [deviation.shot for deviation in comparison.deviations]
    agreeing = state.select(~np.isin(state.samples.shot, outliers), comparison.notes)
    return diagnose(agreeing) if state.diagnoses and not comparison.groups else agreeing


def _causes_of_all_groups(state: CalibrationState, comparison: ShotCheck) -> set[str]:
    """The causes that were diagnosed, and that each of two groups of shots shows, with those that may be of either."""
    causes = {diagnosis.cause for diagnosis in state.diagnoses} - {NOT_ONE_CAMERA}
    for groups in comparison.groups if causes else ():
        for names in (groups.first, groups.second):
            group = diagnose(state.select(np.isin(state.samples.shot, (*names, *groups.either))))
            causes &= {diagnosis.cause for diagnosis in group.diagnoses}
    return causes


def note_dark_end(state: CalibrationState) -> CalibrationState:
    """Note dark greys whose RAW and JPEG values do not go to black together, unless a cause is known that does it."""
    if {known.cause for known in state.diagnoses} - {NOT_ONE_CAMERA}:
        return state
    return replace(state, notes=(*state.notes, *dark_end_notes(state.samples, state.multipliers)))


def check_one_camera(samples: SampleSet) -> None:
    """Raise CalibrationError where samples are too few, or of several cameras."""
    if len(samples) < LEAST_SAMPLES:
        raise CalibrationError(
            f"{len(samples)} samples to calibrate from; at least {LEAST_SAMPLES} are needed: add shots"
        )
    cameras = np.unique(samples.camera)
    if len(cameras) > 1:
        shots = {camera: np.unique(samples.shot[samples.camera == camera]) for camera in cameras[:4]}
        listed = "; ".join(
            f"{camera}: {', '.join(names[:3])}{' …' * (len(names) > 3)}" for camera, names in shots.items()
        )
        raise CalibrationError(f"samples of {len(cameras)} cameras ({listed}): calibrate one camera at a time")
    if len(np.unique(samples.raw_camera)) > 1:
        raise CalibrationError(
            f"the samples hold RAW of several cameras ({', '.join(np.unique(samples.raw_camera)[:4])}): "
            "use the camera's own, or one reference camera"
        )
