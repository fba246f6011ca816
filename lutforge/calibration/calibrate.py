"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import GamutMaps
from lutforge.calibration.physical.reference_camera import own_raw
from lutforge.calibration.physical.white_balance import (
    complete_multipliers,
    named_white_balances,
    with_fitted_gains,
    with_gains,
    with_known_balances,
)
from lutforge.calibration.plausibility.check import implausible
from lutforge.calibration.shots.falloff import at_the_centre, fit_falloffs
from lutforge.calibration.shots.thin_samples import thin_colours, thin_settings
from lutforge.calibration.shots.tone import shot_tones, tone_notes
from lutforge.calibration.shots.tone_correction import without_departures
from lutforge.calibration.stages import Stages, base_of, fit_camera_stages, stages_of
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData, style_data, styles_with_enough, unclipped
from lutforge.calibration.style_fit import StyleFit, fit_style, render_with_plain
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.diagnosis import Diagnosis
from lutforge.model.falloff import Falloff
from lutforge.model.profile_data import PictureStyle
from lutforge.model.reference_raw import with_own_raw
from lutforge.model.shot_tone import ShotTone
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread
from lutforge.threads import each


@dataclass(frozen=True, eq=False)
class CalibratedStyle:
    """What one style's models were fitted to, the fits, and the style as the profile has it.

    maps: the fit of the physical model, where that was asked for.
    """

    data: StyleData
    fit: StyleFit
    maps: GamutMaps | None
    picture: PictureStyle


@dataclass(frozen=True, eq=False)
class Calibration:
    """A fitted profile that still lacks its held-out errors, and what these are measured with.

    styles: data and fits by style name.
    """

    profile: CameraProfile
    styles: Mapping[str, CalibratedStyle] = field(default_factory=dict)


def calibrate(
    samples: SampleSet,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    stages: CameraProfile | None = None,
) -> Calibration:
    """Fit the white balances, the matrix and, per style, the models that the options ask for.

    "lattice": the lattices of both directions; "rbf": the physical model of chapter 4, and the lattices beside it.
    Where a reference camera's RAW stands in (4.9), it is carried to the camera's own first. stages: a profile whose
    responses, matrix and white balances are taken as they are (`calibrate_stages`). Raises CalibrationError, in one
    line with what to do, where the samples do not determine the models.
    """
    options = options or CalibrationOptions()
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        reference = _own_raw_of(samples, options, stages)
        fitted = calibrate(reference.samples, options, progress, stages)
        return replace(fitted, profile=reference.named(fitted.profile))
    even, notes = _prepared(samples, options, stages)
    physical, maps = None, dict[str, GamutMaps]()
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        physical = _fit_stages(even, options, stages)
        maps = physical.maps(even.samples, options)
        even = replace(even, multipliers=physical.multipliers)
    data, clipped = style_data(even.samples, even.multipliers)
    if stages is not None:
        data = {name: replace(style, given=base_of(stages, name)) for name, style in data.items()}
        notes = (*notes, "response and matrix were given: the held-out errors take them as they are")
    notes = (*notes, *even.notes, *_weaknesses(even.samples, data, clipped))
    styles = _fit_styles(data, maps, options, progress)
    progress("done", 1.0)
    matrix = _matrix_of_most(styles) if physical is None else physical.matrix
    matrix = matrix / matrix.sum(axis=1, keepdims=True) if stages is None else stages.matrix
    profile = CameraProfile(
        camera=str(samples.camera[0]),
        matrix=matrix,
        white_balances=named_white_balances(even.samples, even.multipliers, matrix),
        styles={name: style.picture for name, style in styles.items()},
        shots=tuple(name for name, _ in even.samples.by_shot()),
        encoders=tuple(sorted({*even.samples.encoder.tolist()} - {""})),
        options=options.as_json(),
        notes=notes,
        falloffs=even.falloffs,
        diagnoses=even.diagnoses,
        tones=even.tones,
    )
    return Calibration(profile, styles)


def calibrate_stages(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit the responses, the matrix and the white balances alone: a profile whose gamut maps change nothing.

    Raises CalibrationError where the samples do not determine them.
    """
    options = replace(options or CalibrationOptions(), model="rbf")
    _check_one_camera(samples)
    progress("response, matrix and white balances", 0.0)
    if np.any(samples.raw_camera != samples.camera):
        reference = _own_raw_of(samples, options)
        return reference.named(calibrate_stages(reference.samples, options, progress))
    even, notes = _prepared(samples, options)
    stages = _fit_stages(even, options)
    balances = named_white_balances(even.samples, stages.multipliers, stages.matrix)
    progress("done", 1.0)
    return CameraProfile(
        camera=str(samples.camera[0]),
        matrix=stages.matrix / stages.matrix.sum(axis=1, keepdims=True),
        white_balances=balances,
        styles=stages.styles(tuple(balances)),
        shots=tuple(name for name, _ in even.samples.by_shot()),
        encoders=tuple(sorted({*even.samples.encoder.tolist()} - {""})),
        options=options.as_json(),
        notes=(*notes, *even.notes),
        falloffs=even.falloffs,
        diagnoses=even.diagnoses,
        tones=even.tones,
    )


@dataclass(frozen=True, eq=False)
class _Reference:
    """Samples with the camera's own RAW, as far as a reference camera tells it: its name, Tc (3, 3), and notes."""

    samples: SampleSet
    name: str
    transfer: Array
    notes: tuple[str, ...]

    def named(self, profile: CameraProfile) -> CameraProfile:
        """The profile of these samples, as one through the reference camera."""
        return replace(profile, raw_camera=self.name, raw_transfer=self.transfer, notes=(*self.notes, *profile.notes))


def _own_raw_of(samples: SampleSet, options: CalibrationOptions, stages: CameraProfile | None = None) -> _Reference:
    """Carry the reference camera's RAW to the camera's own, by the matrix of given stages, or by one that is fitted."""
    name, count = str(samples.raw_camera[0]), len(samples)
    if stages is not None and stages.raw_transfer is not None:
        samples, transfer = with_own_raw(stages, samples), stages.raw_transfer
    else:
        carried = own_raw(samples, options.preset, options.physical)
        samples, transfer = carried.samples, carried.transfer
    notes = [f"RAW of {name} stands in: refinishing works, linearizing to the own RAW cannot"]
    if len(samples) < count:
        notes.append(f"{count - len(samples)} of {count} samples are clipped, in the JPEG or in that RAW")
    return _Reference(samples, name, transfer, tuple(notes))


@dataclass(frozen=True, eq=False)
class _Even:
    """Samples that one rendering serves, and what was taken out of them. multipliers: (n, 3), with settings' gains."""

    samples: SampleSet
    multipliers: Array
    falloffs: tuple[Falloff, ...]
    diagnoses: tuple[Diagnosis, ...]
    tones: tuple[ShotTone, ...]

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of it."""
        return (*(falloff.note for falloff in self.falloffs), *tone_notes(self.tones))


def _prepared(
    samples: SampleSet, options: CalibrationOptions, stages: CameraProfile | None = None
) -> tuple[_Even, tuple[str, ...]]:
    """The samples of styles with enough of them, evened, with the white balances of given stages; and notes."""
    if stages is not None:
        samples = with_known_balances(samples, stages.white_balances)
    multipliers, notes = complete_multipliers(samples)
    enough, left_out = styles_with_enough(samples, multipliers)
    return _even(samples.select(enough), multipliers[enough], options, stages), (*notes, *left_out)


def _fit_stages(even: _Even, options: CalibrationOptions, stages: CameraProfile | None = None) -> Stages:
    if stages is not None:
        return stages_of(stages, even.samples, even.multipliers)
    return fit_camera_stages(even.samples, even.multipliers, options)


def _even(
    samples: SampleSet, multipliers: Array, options: CalibrationOptions, stages: CameraProfile | None = None
) -> _Even:
    """Take out what lens, setting and scene add to the brightness of JPEGs. The thesis knows settings' gains only.

    Where something is wrong with the whole set, no shot is blamed for it.
    """
    thesis = options.preset == "thesis"
    falloffs = () if thesis else fit_falloffs(samples, multipliers, unclipped(samples, multipliers))
    samples = at_the_centre(samples, falloffs)
    diagnoses = implausible(samples, multipliers)
    if stages is None:
        multipliers = with_fitted_gains(samples, multipliers, unclipped(samples, multipliers))
    else:
        multipliers = with_gains(samples, multipliers, stages.white_balances)
    blameless = thesis or any(diagnosis.whole_set for diagnosis in diagnoses)
    tones = () if blameless else shot_tones(samples, multipliers, unclipped(samples, multipliers))
    samples, multipliers = without_departures(samples, multipliers, unclipped(samples, multipliers), tones)
    if tones:  # of what they explain nothing is left to diagnose
        diagnoses = implausible(samples, multipliers)
    return _Even(samples, multipliers, falloffs, diagnoses, tones)


def _weaknesses(samples: SampleSet, data: Mapping[str, StyleData], clipped: int) -> list[str]:
    """Notes on what is thin in the samples."""
    notes = [*thin_settings(samples)]
    if clipped:
        notes.append(f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    for name, style in data.items():
        notes += thin_colours(style.encoded, name, monochrome=style.monochrome)
    return notes


@one_blas_thread
def _fit_styles(
    data: Mapping[str, StyleData], maps: Mapping[str, GamutMaps], options: CalibrationOptions, progress: Progress
) -> dict[str, CalibratedStyle]:
    """Fit the lattices of both directions; several styles beside each other.

    What the held-out errors need of the samples alone is made beside them, by processors that a fit leaves idle.
    """

    def fitted(name: str) -> CalibratedStyle:
        style, physical = data[name], maps.get(name)
        fit = fit_style(style, options)
        picture = PictureStyle(
            render=render_with_plain(style, fit, options),
            linearize=fit.linearize.lattice,
            physical=() if physical is None else (physical.model,),
            coverage={"render": fit.render.coverage, "linearize": fit.linearize.coverage},
        )
        return CalibratedStyle(style, fit, physical, picture)

    def prepare(fold: StyleData) -> None:
        with suppress(CalibrationError):  # the fit without its shots tells it
            for inverse in (False, True) if options.model == "lattice" else ():
                fold.guess(options.size, inverse=inverse)

    progress(f"fitting {', '.join(data)}", 0.0)
    folds = [fold for style in data.values() if len(style.folds) > 1 for _, fold in style.folds]
    tasks: list[Callable[[], CalibratedStyle | None]] = [partial(fitted, name) for name in data]
    tasks += [partial(prepare, fold) for fold in folds]
    styles = {}
    for name, style in zip([*data, *[""] * len(folds)], each(lambda task: task(), tasks), strict=True):
        if style is not None:
            styles[name] = style
            progress(f"{name}: fitted", len(styles) / len(data))
    return styles


def _matrix_of_most(styles: Mapping[str, CalibratedStyle]) -> Array:
    """Ts of the style with most samples; the identity where all are black and white: their JPEGs tell no matrix."""
    coloured = [style for style in styles.values() if not style.data.monochrome]
    return max(coloured, key=lambda style: len(style.data.shot)).fit.base.matrix if coloured else np.eye(3)


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


def data_by_style(samples: SampleSet) -> dict[str, StyleData]:
    """The fitting samples of each style of one camera. Raises CalibrationError."""
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        samples = own_raw(samples).samples
    even = _even(samples, complete_multipliers(samples)[0], CalibrationOptions())
    return style_data(even.samples, even.multipliers)[0]
