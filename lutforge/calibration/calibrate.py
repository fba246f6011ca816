"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import GamutMaps, fit_gamut_maps, fit_stages
from lutforge.calibration.physical.reference_camera import calibrate_by_reference
from lutforge.calibration.physical.white_balance import complete_multipliers, named_white_balances, with_fitted_gains
from lutforge.calibration.plausibility.check import implausible
from lutforge.calibration.shots.falloff import at_the_centre, fit_falloffs
from lutforge.calibration.shots.thin_samples import thin_colours, thin_settings
from lutforge.calibration.shots.tone import shot_tones, tone_notes, without_departures
from lutforge.calibration.style_data import LEAST_SAMPLES, StyleData, style_data, styles_with_enough, unclipped
from lutforge.calibration.style_fit import StyleFit, fit_style, render_with_plain
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.diagnosis import Diagnosis
from lutforge.model.falloff import Falloff
from lutforge.model.profile_data import PictureStyle
from lutforge.model.shot_tone import ShotTone
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet


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

    styles: data and fits by style name; empty for a camera that was calibrated through a reference camera.
    """

    profile: CameraProfile
    styles: Mapping[str, CalibratedStyle] = field(default_factory=dict)


def calibrate(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = silent
) -> Calibration:
    """Fit the white balances, the matrix and, per style, the models that the options ask for.

    "lattice": the lattices of both directions; "rbf": the physical model of chapter 4, and the lattices beside it.
    Samples with a reference camera's RAW get the physical model only (4.9). Raises CalibrationError, in one line with
    what to do, where the samples do not determine it.
    """
    options = options or CalibrationOptions()
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        return Calibration(calibrate_by_reference(samples, options, progress))
    multipliers, notes = complete_multipliers(samples)
    enough, left_out = styles_with_enough(samples, multipliers)
    even = _even(samples.select(enough), multipliers[enough], options)
    physical = None
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        physical = _fit_physical(even, options)
        even = replace(even, multipliers=physical.multipliers)
    data, clipped = style_data(even.samples, even.multipliers)
    notes = (*notes, *left_out, *even.notes, *_weaknesses(even.samples, data, clipped))
    styles = _fit_styles(data, {} if physical is None else physical.maps, options, progress)
    progress("done", 1.0)
    matrix = _matrix_of_most(styles) if physical is None else physical.matrix
    matrix = matrix / matrix.sum(axis=1, keepdims=True)
    profile = CameraProfile(
        camera=str(samples.camera[0]),
        matrix=matrix,
        white_balances=named_white_balances(even.samples, even.multipliers, matrix),
        styles={name: style.picture for name, style in styles.items()},
        shots=tuple(name for name, _ in even.samples.by_shot()),
        options=options.as_json(),
        notes=notes,
        falloffs=even.falloffs,
        diagnoses=even.diagnoses,
        tones=even.tones,
    )
    return Calibration(profile, styles)


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


def _even(samples: SampleSet, multipliers: Array, options: CalibrationOptions) -> _Even:
    """Take out what lens, setting and scene add to the brightness of JPEGs. The thesis knows settings' gains only.

    Where something is wrong with the whole set, no shot is blamed for it.
    """
    thesis = options.preset == "thesis"
    falloffs = () if thesis else fit_falloffs(samples, multipliers, unclipped(samples, multipliers))
    samples = at_the_centre(samples, falloffs)
    diagnoses = implausible(samples, multipliers)
    multipliers = with_fitted_gains(samples, multipliers, unclipped(samples, multipliers))
    blameless = thesis or any(diagnosis.whole_set for diagnosis in diagnoses)
    tones = () if blameless else shot_tones(samples, multipliers, unclipped(samples, multipliers))
    samples, multipliers = without_departures(samples, multipliers, tones)
    if tones:  # of what they explain nothing is left to diagnose
        diagnoses = implausible(samples, multipliers)
    return _Even(samples, multipliers, falloffs, diagnoses, tones)


@dataclass(frozen=True, eq=False)
class _Physical:
    """Fit the physical stages. Return Ts (3, 3), the multipliers (n, 3) of all samples, and the gamut maps by style.

    Black-and-white styles are left out.
    """

    matrix: Array
    multipliers: Array
    maps: dict[str, GamutMaps]


def _fit_physical(even: _Even, options: CalibrationOptions) -> _Physical:
    """Response, matrix and white balances together, then a gamut map per style."""
    samples, multipliers = even.samples, even.multipliers
    without = [name for name, style in style_data(samples, multipliers)[0].items() if style.monochrome]
    usable = unclipped(samples, multipliers) & ~np.isin(samples.style, without)
    if not usable.any():
        raise CalibrationError(
            f'style "{without[0]}" is black and white: its JPEGs hold no colour to fit the physical model to: '
            'use the "lattice" model, or add shots in another style'
        )
    inside, known = samples.select(usable), np.all(np.isfinite(samples.wb), axis=1)
    stages = fit_stages(inside, multipliers[usable], known[usable], options.preset)
    completed = multipliers.copy()
    completed[usable] = stages.multipliers
    automatic = np.where(samples.white_balance == "auto", np.char.add("auto\x00", samples.shot), samples.white_balance)
    for setting in np.unique(automatic[~known]):
        fitted = ~known & (automatic == setting) & usable
        if fitted.any():
            completed[~known & (automatic == setting)] = completed[fitted][0]
    balances = tuple(str(name) for name in np.unique(samples.white_balance))
    maps = {}
    for name, style in stages.styles.items():
        rows = usable & (samples.style == name)
        maps[name] = fit_gamut_maps(
            samples.raw[rows] * completed[rows], samples.srgb[rows], samples.shot[rows], stages.matrix,
            style.response, balances, preset=options.preset,
        )  # fmt: skip
    return _Physical(stages.matrix, completed, maps)


def _weaknesses(samples: SampleSet, data: Mapping[str, StyleData], clipped: int) -> list[str]:
    """Notes on what is thin in the samples."""
    notes = [*thin_settings(samples)]
    if clipped:
        notes.append(f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    for name, style in data.items():
        notes += thin_colours(style.encoded, name, monochrome=style.monochrome)
    return notes


def _fit_styles(
    data: Mapping[str, StyleData], maps: Mapping[str, GamutMaps], options: CalibrationOptions, progress: Progress
) -> dict[str, CalibratedStyle]:
    """Fit the lattices of both directions, style by style."""
    styles = {}
    for index, (name, style) in enumerate(data.items()):
        progress(f"{name}: fitting", index / len(data))
        fit, physical = fit_style(style, options), maps.get(name)
        picture = PictureStyle(
            render=render_with_plain(style, fit, options),
            linearize=fit.linearize.lattice,
            physical=() if physical is None else (physical.model,),
            coverage={"render": fit.render.coverage, "linearize": fit.linearize.coverage},
        )
        styles[name] = CalibratedStyle(style, fit, physical, picture)
    return styles


def _matrix_of_most(styles: Mapping[str, CalibratedStyle]) -> Array:
    """Ts of the style with most samples; of a black-and-white one only where there is no other."""
    most = max(styles.values(), key=lambda style: (not style.data.monochrome, len(style.data.shot)))
    return most.fit.base.matrix


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
    """The fitting samples of each style of one camera with RAW of its own. Raises CalibrationError."""
    _check_one_camera(samples)
    if np.any(samples.raw_camera != samples.camera):
        raise CalibrationError(
            f"{samples.camera[0]} was sampled with another camera's RAW: its model has no lattice to choose a size of"
        )
    even = _even(samples, complete_multipliers(samples)[0], CalibrationOptions())
    return style_data(even.samples, even.multipliers)[0]
