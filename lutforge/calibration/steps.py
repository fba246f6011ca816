"""The steps that prepare samples for the fit of each style: functions of a state, each with its own condition and note.

A step takes the state that the one before it left, and returns it as it is or with other samples, white balances or
notes. Matrix and response of a style, its base, are fitted when a step first asks for them, and handed on until a step
changes the samples that they were fitted to.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.checks import LEAST_TO_CHECK, NOT_ONE_CAMERA, implausible
from lutforge.calibration.dark_greys import dark_end_notes
from lutforge.calibration.lattice.monochrome import is_monochrome
from lutforge.calibration.matrix_and_response import (
    MatrixAndResponse,
    MatrixAndResponseFit,
    fit_matrix_and_response,
    with_matrix_of_all,
)
from lutforge.calibration.options import BETA, CURVES
from lutforge.calibration.reference_camera import own_raw
from lutforge.calibration.shot_comparison import ShotCheck, check_shots
from lutforge.calibration.style import LEAST_SAMPLES, styles_with_enough, unclipped
from lutforge.calibration.vignetting import at_the_centre, fit_vignettings
from lutforge.calibration.white_balance import (
    complete_multipliers,
    fitted_gains,
    times_gains,
    with_gains,
    with_known_balances,
)
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import Diagnosis
from lutforge.model.provenance import OwnRaw, Provenance, ReferenceRaw
from lutforge.model.reference_raw import with_own_raw
from lutforge.model.vignetting import Vignetting
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True, eq=False)
class State:
    """Samples of one camera on their way to a profile, and the corrections that were applied to them.

    multipliers: Tw (n, 3) of the samples, with the gains of settings; beta, curves: as of `CalibrationOptions`; given:
    a profile whose responses, matrices and white balances hold as they are, or None. provenance: what the RAW of the
    samples was: own, or a reference camera's. notes: what a user should know. bases: of the styles whose base was
    fitted to the present samples.
    """

    samples: SampleSet
    multipliers: Array
    beta: float = BETA
    curves: int = CURVES
    given: CameraProfile | None = None
    provenance: Provenance = field(default_factory=OwnRaw)
    vignettings: tuple[Vignetting, ...] = ()
    diagnoses: tuple[Diagnosis, ...] = ()
    notes: tuple[str, ...] = ()
    bases: dict[str, MatrixAndResponseFit] = field(default_factory=dict)

    @property
    def balanced(self) -> Array:
        """Tw E, (n, 3)."""
        return np.asarray(self.samples.raw * self.multipliers)

    @property
    def unclipped(self) -> Mask:
        """(n,): the samples that fits may take."""
        return unclipped(self.samples, self.multipliers)

    @property
    def styles(self) -> list[str]:
        """The names of the picture styles with unclipped samples."""
        return [str(name) for name in np.unique(self.samples.style[self.unclipped])]

    def rows(self, style: str) -> Mask:
        """(n,): the unclipped samples of a style."""
        return np.asarray(self.unclipped & (self.samples.style == style))

    def base(self, style: str) -> MatrixAndResponseFit:
        """The matrix and response of the unclipped samples of a style. Raises CalibrationError."""
        if style not in self.bases:
            rows = self.rows(style)
            saturates = self.samples.is_own_raw
            self.bases[style] = fit_matrix_and_response(
                self.balanced[rows], self.samples.srgb[rows], self.beta, self.curves, saturates=saturates
            )
        return self.bases[style]

    def coloured_bases(self) -> Mapping[str, MatrixAndResponseFit]:
        """The base of each style that is not black and white."""
        return {
            style: self.base(style)
            for style in self.styles
            if not is_monochrome(self.balanced[self.rows(style)], self.samples.srgb[self.rows(style)])
        }

    def bases_of_all_colours(self) -> dict[str, MatrixAndResponse]:
        """The base of each style with colours and samples enough to check, its matrix fitted to saturated colours, too.

        A style whose base cannot be fitted is not there.
        """
        bases = dict[str, MatrixAndResponse]()
        for style in self.styles:
            rows = self.rows(style)
            balanced, encoded = self.balanced[rows], self.samples.srgb[rows]
            if len(encoded) < LEAST_TO_CHECK or is_monochrome(balanced, encoded):
                continue
            try:
                bases[style] = with_matrix_of_all(self.base(style), balanced, encoded)
            except (CalibrationError, np.linalg.LinAlgError):
                continue
        return bases

    def given_base(self, style: str) -> MatrixAndResponse | None:
        """The matrix and response that hold for a style whatever the samples are; None where they are to be fitted."""
        known = () if self.given is None or style not in self.given.styles else self.given.styles[style].models
        return MatrixAndResponse(known[0].matrix, known[0].response) if known else None

    def with_samples(self, samples: SampleSet, multipliers: Array, notes: Iterable[str] = ()) -> "State":
        """The state with other samples or white balances; bases stay of styles whose unclipped samples are the same."""
        changed = replace(self, samples=samples, multipliers=multipliers, notes=(*self.notes, *notes), bases={})
        for style, base in self.bases.items():
            before, after = self.rows(style), changed.rows(style)
            same = np.array_equal(self.balanced[before], changed.balanced[after])
            if same and np.array_equal(self.samples.srgb[before], samples.srgb[after]):
                changed.bases[style] = base
        return changed

    def select(self, rows: Mask, notes: Iterable[str] = ()) -> "State":
        """The state of some of its samples, a mask (n,)."""
        return self.with_samples(self.samples.select(rows), self.multipliers[rows], notes)


Step = Callable[[State], State]

GAIN_ROUNDS = 6
"""Rounds of gains, at most."""


def use_reference_raw(state: State) -> State:
    """Transform a reference camera's RAW to the camera's own (4.9), where the samples hold such RAW."""
    return reference_raw_by(state, lambda samples: own_raw(samples, state.beta, state.curves))


def reference_raw_by(state: State, transform: Callable[[SampleSet], tuple[SampleSet, Array]]) -> State:
    """Transform a reference camera's RAW by a function that returns the samples and Tc, or by a given profile's Tc."""
    samples = state.samples
    check_one_camera(samples)
    if np.all(samples.raw_camera == samples.camera):
        return state

    raw_camera = str(samples.raw_camera[0])
    if state.given is not None and isinstance(state.given.provenance, ReferenceRaw):
        own, transfer = with_own_raw(state.given, samples), state.given.provenance.transfer
    else:
        own, transfer = transform(samples)
    check_one_camera(own)
    notes = [f"RAW of {raw_camera} replaces the camera's: refinishing works, linearizing to the own RAW cannot"]
    if len(own) < len(samples):
        lost = len(samples) - len(own)
        notes.append(f"{lost} of {len(samples)} samples are clipped, in the JPEG or in that RAW")
    own_state = replace(state, samples=own, multipliers=own.wb, notes=(*state.notes, *notes))
    return replace(own_state, provenance=ReferenceRaw(raw_camera, transfer))


def complete_white_balances(state: State) -> State:
    """Estimate the multipliers that the files do not state, or take them from a given profile."""
    samples = state.samples
    if state.given is not None:
        samples = with_known_balances(samples, state.given.white_balances)
    multipliers, notes = complete_multipliers(samples)
    return state.with_samples(samples, multipliers, notes)


def drop_small_styles(state: State) -> State:
    """Leave out the styles with too few samples, each with a note. Raises CalibrationError where none is left."""
    enough, notes = styles_with_enough(state.samples, state.multipliers)
    if state.given is not None:
        notes = (*notes, "response and matrix were given: the held-out errors take them as they are")
    return state.select(enough, notes)


def correct_vignetting(state: State) -> State:
    """Remove from the RAW the vignetting that the camera corrects in its JPEGs only, where it is significant."""
    vignettings = fit_vignettings(state.samples, state.multipliers, state.unclipped)
    if not vignettings:
        return state
    centred = at_the_centre(state.samples, vignettings)
    corrected = state.with_samples(centred, state.multipliers, (vignetting.note for vignetting in vignettings))
    return replace(corrected, vignettings=vignettings)


def diagnose(state: State) -> State:
    """Recognize samples that no camera makes, and what made them so."""
    of_all = state.bases_of_all_colours()
    of_unsaturated = {style: state.base(style) for style in of_all}
    return replace(state, diagnoses=implausible(state.samples, state.multipliers, of_all, of_unsaturated))


def fit_gains(state: State) -> State:
    """Fit the common factor that a setting has besides its multipliers, or take a given profile's.

    Each round compares the settings by a base that is fitted with the gains of the round before, first without any:
    where settings have few tones in common, gains that were fitted with the response would trade with it.
    """
    samples, multipliers = state.samples, state.multipliers
    if state.given is not None:
        return state.with_samples(samples, with_gains(samples, multipliers, state.given.white_balances))

    gains = {str(name): 1.0 for name in np.unique(samples.white_balance[state.unclipped]) if name != "auto"}
    for _ in range(GAIN_ROUNDS if len(gains) > 1 else 0):
        bases = {style: state.base(style) for style in state.styles}
        improved = fitted_gains(samples, state.multipliers, state.unclipped, bases, gains)
        if improved == gains:
            break
        gains = improved
        state = state.with_samples(samples, times_gains(samples, multipliers, gains))
    return state


def drop_outlier_shots(state: State) -> State:
    """Leave out the shots that deviate from the others of their style; name two groups of shots, and leave none out.

    Where a cause spoils the whole set, so that each group shows it, no shot is at fault.
    """
    comparison = check_shots(state.samples, state.multipliers, state.unclipped, state.bases_of_all_colours())
    spoilt = _causes_of_all_groups(state, comparison)
    if spoilt:
        return replace(state, diagnoses=tuple(known for known in state.diagnoses if known.cause in spoilt))

    if comparison.deviations:
        agree = ~np.isin(state.samples.shot, [deviation.shot for deviation in comparison.deviations])
        state = state.select(agree, comparison.notes)
    if comparison.groups:
        return replace(state, diagnoses=tuple(groups.diagnosis for groups in comparison.groups))
    # The shots that agree may look like one camera's
    return diagnose(state) if comparison.deviations and state.diagnoses else state


def _causes_of_all_groups(state: State, comparison: ShotCheck) -> set[str]:
    """The causes that were diagnosed, and that each of two groups of shots shows by itself."""
    causes = {diagnosis.cause for diagnosis in state.diagnoses} - {NOT_ONE_CAMERA}
    for groups in comparison.groups if causes else ():
        for names in (groups.first, groups.second):
            group = diagnose(state.select(np.isin(state.samples.shot, names)))
            causes &= {diagnosis.cause for diagnosis in group.diagnoses}
    return causes


def note_dark_end(state: State) -> State:
    """Note dark greys whose RAW and JPEG values do not go to black together, unless a cause is known that does it."""
    if state.diagnoses:
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
        raise CalibrationError(
            f"samples of {len(cameras)} cameras ({', '.join(cameras[:4])}): calibrate one camera at a time"
        )
    if len(np.unique(samples.raw_camera)) > 1:
        raise CalibrationError(
            f"the samples hold RAW of several cameras ({', '.join(np.unique(samples.raw_camera)[:4])}): "
            "use the camera's own, or one reference camera"
        )
