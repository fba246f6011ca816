"""Prepares samples for the fits: the camera's own RAW, complete white balances, no shots that depart from others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.departures import departing_shots, departure_notes
from lutforge.calibration.falloff import at_the_centre, fit_falloffs
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.reference_camera import own_raw
from lutforge.calibration.physical.white_balance import (
    complete_multipliers,
    with_fitted_gains,
    with_gains,
    with_known_balances,
)
from lutforge.calibration.plausibility import NOT_ONE_CAMERA, implausible
from lutforge.calibration.style import LEAST_SAMPLES, styles_with_enough, unclipped
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.falloff import Falloff
from lutforge.model.profile_data import Diagnosis, PictureStyle
from lutforge.model.reference_raw import with_own_raw
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet


@dataclass(frozen=True, eq=False)
class PreparedSamples:
    """Samples of one camera that follow one rendering, and the corrections that were applied to them.

    multipliers: Tw (n, 3), with the gains of settings. raw_camera, raw_transfer: the reference camera whose RAW stood
    in, and Tc (3, 3); "" and None for own RAW. notes: what a user should know.
    """

    samples: SampleSet
    multipliers: Array
    raw_camera: str
    raw_transfer: Array | None
    falloffs: tuple[Falloff, ...]
    diagnoses: tuple[Diagnosis, ...]
    notes: tuple[str, ...]

    def profile(
        self,
        matrix: Array,
        white_balances: Mapping[str, WhiteBalance],
        styles: Mapping[str, PictureStyle],
        options: CalibrationOptions,
        notes: Sequence[str] = (),
    ) -> CameraProfile:
        """The profile of what was fitted to these samples. notes: what the fits add."""
        return CameraProfile(
            camera=str(self.samples.camera[0]),
            matrix=matrix,
            white_balances=white_balances,
            styles=styles,
            shots=tuple(name for name, _ in self.samples.by_shot()),
            options=options.as_json(),
            notes=(*self.notes, *notes),
            raw_camera=self.raw_camera,
            raw_transfer=self.raw_transfer,
            falloffs=self.falloffs,
            diagnoses=self.diagnoses,
        )


def prepare(samples: SampleSet, options: CalibrationOptions, stages: CameraProfile | None = None) -> PreparedSamples:
    """Prepare the samples of styles with enough of them.

    A reference camera's RAW is transformed to the camera's own (4.9). Then white balances are completed, and the
    brightness that lens and setting add to JPEGs is removed, and shots that depart from the others are left out; the
    thesis preset removes the brightness of settings only. Where the whole set is implausible, no shot is blamed.
    stages: a profile whose white balances, and matrix from a reference's RAW, are taken as they are. Raises
    CalibrationError where the samples cannot be calibrated from.
    """
    _check_one_camera(samples)
    raw_camera, transfer, notes = "", None, list[str]()
    if np.any(samples.raw_camera != samples.camera):
        raw_camera, count = str(samples.raw_camera[0]), len(samples)
        if stages is not None and stages.raw_transfer is not None:
            samples, transfer = with_own_raw(stages, samples), stages.raw_transfer
        else:
            samples, transfer = own_raw(samples, options.preset, options.physical)
        notes.append(f"RAW of {raw_camera} stands in: refinishing works, linearizing to the own RAW cannot")
        if len(samples) < count:
            notes.append(f"{count - len(samples)} of {count} samples are clipped, in the JPEG or in that RAW")
        _check_one_camera(samples)
    if stages is not None:
        samples = with_known_balances(samples, stages.white_balances)
    multipliers, of_balances = complete_multipliers(samples)
    enough, left_out = styles_with_enough(samples, multipliers)
    samples, multipliers = samples.select(enough), multipliers[enough]
    thesis = options.preset == "thesis"
    falloffs = () if thesis else fit_falloffs(samples, multipliers, unclipped(samples, multipliers))
    samples = at_the_centre(samples, falloffs)
    diagnoses = implausible(samples, multipliers)
    if stages is None:
        multipliers = with_fitted_gains(samples, multipliers, unclipped(samples, multipliers))
    else:
        multipliers = with_gains(samples, multipliers, stages.white_balances)
    blameless = thesis or any(diagnosis.cause != NOT_ONE_CAMERA for diagnosis in diagnoses)
    departures = () if blameless else departing_shots(samples, multipliers, unclipped(samples, multipliers))
    agree = ~np.isin(samples.shot, [departure.shot for departure in departures])
    samples, multipliers = samples.select(agree), multipliers[agree]
    if departures and diagnoses:  # the shots that agree may look like one camera's
        diagnoses = implausible(samples, multipliers)
    given = "response and matrix were given: the held-out errors take them as they are"
    notes += [*of_balances, *left_out, *([] if stages is None else [given])]
    notes += [*(falloff.note for falloff in falloffs), *departure_notes(departures)]
    return PreparedSamples(samples, multipliers, raw_camera, transfer, falloffs, diagnoses, tuple(notes))


def _check_one_camera(samples: SampleSet) -> None:
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
