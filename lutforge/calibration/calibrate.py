"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lutforge.arrays import Array, Mask
from lutforge.calibration.departures import departing_shots, departure_notes
from lutforge.calibration.lattice.fit import node_coverage
from lutforge.calibration.lattice.monochrome import monochrome_note
from lutforge.calibration.matrix_and_response import BETA, LEAST_UNSATURATED, MatrixAndResponse, saturation
from lutforge.calibration.options import CalibrationOptions, PhysicalOptions
from lutforge.calibration.physical_model import CameraStages, fit_gamut_maps, fit_stages
from lutforge.calibration.plausibility import NOT_ONE_CAMERA, implausible
from lutforge.calibration.reference_camera import own_raw
from lutforge.calibration.style import LEAST_SAMPLES, StyleData, fit_lattices, style_data, styles_with_enough, unclipped
from lutforge.calibration.vignetting import at_the_centre, fit_vignettings
from lutforge.calibration.white_balance import (
    complete_multipliers,
    named_white_balances,
    with_fitted_gains,
    with_gains,
    with_known_balances,
)
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.gamut_map import identity_gamut_map
from lutforge.model.profile_data import Diagnosis, PhysicalModel, PictureStyle
from lutforge.model.reference_raw import with_own_raw
from lutforge.model.vignetting import Vignetting
from lutforge.model.white_balance import WhiteBalance
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.threads import each, one_blas_thread


@one_blas_thread
def calibrate(
    samples: SampleSet,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    stages: CameraProfile | None = None,
) -> tuple[CameraProfile, dict[str, StyleData]]:
    """Fit the white balances, the matrix and, per style, the camera model and the lattices that are its fast form.

    stages: a profile whose responses, matrix and white balances are taken as they are (`calibrate_stages`). Returns a
    profile without held-out errors, and by style the data that these are measured with. Raises CalibrationError, in one
    line with what to do, where the samples do not determine the models.
    """
    options = options or CalibrationOptions()
    if options.preset != "thesis" and options.physical.rho is not None:
        raise CalibrationError('ρ is of the gamut map of the preset "thesis"; kriging has none: leave rho out')
    if options.preset == "thesis" and options.physical.weighting != PhysicalOptions.weighting:
        raise CalibrationError('the preset "thesis" has no weights of tones: leave weighting out')
    progress("checking white balances and shots", 0.0)
    prepared = prepare(samples, options, stages)
    samples, multipliers = prepared.samples, prepared.multipliers
    physical: Mapping[str, PhysicalModel] = {}
    matrix = None if stages is None else stages.matrix
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        if stages is None:
            fitted, usable = fit_camera_stages(samples, multipliers, options)
        else:
            fitted, usable = stages_of(stages, samples, multipliers)
        multipliers = fitted.multipliers
        if options.preset == "thesis":
            physical = _gamut_maps(fitted, samples, usable, options)
            matrix = fitted.matrix if matrix is None else matrix
    data, clipped = style_data(samples, multipliers)
    for name, of_style in data.items():
        known = () if stages is None or name not in stages.styles else stages.styles[name].physical
        given = MatrixAndResponse(known[0].matrix, known[0].response) if known else None
        data[name] = replace(of_style, physical=options.physical, given=given)

    def fitted_style(name: str) -> PictureStyle:
        style = data[name]
        lattices = fit_lattices(style, options)
        coverage = {direction: node_coverage(one, style.both[direction][0]) for direction, one in lattices.items()}
        own = () if style.monochrome or options.preset == "thesis" else (style.model,)
        models = (physical[name],) if name in physical else own
        return PictureStyle(lattices.render, lattices.linearize, models, coverage=coverage)

    progress(f"fitting {', '.join(data)}", 0.0)
    styles = {}
    for name, style in zip(data, each(fitted_style, list(data)), strict=True):
        styles[name] = style
        progress(f"{name}: fitted", len(styles) / len(data))
    progress("done", 1.0)
    if matrix is None:
        # Ts of the style with most samples; the identity where all styles are black and white.
        coloured = [style for style in data.values() if not style.monochrome]
        matrix = max(coloured, key=lambda one: len(one.shot)).unsaturated.matrix if coloured else np.eye(3)
    if stages is None:
        matrix = matrix / matrix.sum(axis=1, keepdims=True)
    balances = named_white_balances(samples, multipliers, matrix)
    notes = thin_settings(samples)
    if clipped:
        notes.append(f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    for name, of_style in data.items():
        notes += thin_colours(of_style.encoded, name, monochrome=of_style.monochrome)
    if presets := [name for name in balances if name not in samples.white_balance]:
        computed = "are computed by the camera's matrix: no shot was taken with them"
        notes.append(f"white balances {', '.join(presets)} {computed}")
    return prepared.profile(matrix, balances, styles, options, notes), data


@one_blas_thread
def calibrate_stages(
    samples: SampleSet, options: CalibrationOptions | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit the responses, the matrix and the white balances alone: a profile whose gamut maps change nothing.

    Raises CalibrationError where the samples do not determine them.
    """
    options = replace(options or CalibrationOptions(), model="rbf")
    progress("checking white balances and shots", 0.0)
    prepared = prepare(samples, options)
    progress("response, matrix and white balances", 0.0)
    stages, _ = fit_camera_stages(prepared.samples, prepared.multipliers, options)
    balances = named_white_balances(prepared.samples, stages.multipliers, stages.matrix)
    progress("done", 1.0)
    matrix = stages.matrix / stages.matrix.sum(axis=1, keepdims=True)
    none = identity_gamut_map()
    models = {
        name: PhysicalModel(tuple(balances), stages.matrix, response, none, none)
        for name, response in stages.responses.items()
    }
    styles = {name: PictureStyle(physical=(model,)) for name, model in models.items()}
    return prepared.profile(matrix, balances, styles, options)


def thin_settings(samples: SampleSet) -> list[str]:
    """Return notes on white balances with a single shot, and on styles with a single exposure."""
    notes = []
    for name in np.unique(samples.white_balance):
        shots = np.unique(samples.shot[samples.white_balance == name])
        if len(shots) == 1 and len(np.unique(samples.shot)) > 1:
            notes.append(
                f'white balance "{name}": one shot only ({shots[0]}); nothing can be checked against it: add a second'
            )
    for name in np.unique(samples.style):
        rows = samples.style == name
        times = samples.exposure_s[rows & np.isfinite(samples.exposure_s)]
        if len(times) and np.ptp(np.log2(times)) < 0.1:
            notes.append(
                f'style "{name}": one exposure only: shoot the same at −2 and +1 EV, too, for dark and light tones'
            )
    return notes


def thin_colours(encoded: Array, style: str, *, monochrome: bool) -> list[str]:
    """Notes on the colours that a style's unclipped samples (n, 3) lack; monochrome: the style is black and white."""
    notes = []
    if (saturation(encoded) < BETA).sum() < LEAST_UNSATURATED:
        notes.append(
            f'style "{style}": hardly any unsaturated colours, so its greys are guessed: '
            "shoot a grey card or a colour chart at several exposures"
        )
    brightest = float(np.max(encoded, initial=0.0))
    # Encoded value that the brightest unclipped sample of a style should reach
    if brightest < 0.85:
        notes.append(
            f'style "{style}": no sample is brighter than {brightest:.0%} of white, so brighter tones are guessed, '
            "and the errors do not show it: expose more"
        )
    if monochrome:
        return [*notes, monochrome_note(style)]
    shares = encoded / encoded.sum(axis=1, keepdims=True)
    spread = np.linalg.svd(shares - shares.mean(axis=0), compute_uv=False)
    # Shares of red, green and blue that spread less than this in their second direction are of one hue, or grey
    if spread[1] < 0.02 * np.sqrt(len(encoded)):
        notes.append(
            f'style "{style}": all colours are grey or of one hue, so all others are guessed: '
            "shoot a colour chart or a scene of many colours"
        )
    return notes


def _gamut_maps(
    stages: CameraStages, samples: SampleSet, usable: Mask, options: CalibrationOptions
) -> dict[str, PhysicalModel]:
    """Fit h and h⁻¹ of each style that has usable samples (n,). Raises CalibrationError."""
    balances, maps = tuple(str(name) for name in np.unique(samples.white_balance)), {}
    for name, response in stages.responses.items():
        rows = usable & (samples.style == name)
        if rows.any():
            balanced, shot = samples.raw[rows] * stages.multipliers[rows], samples.shot[rows]
            maps[name] = fit_gamut_maps(
                balanced, samples.srgb[rows], shot, stages.matrix, response, balances, options.physical
            )
    return maps


def fit_camera_stages(samples: SampleSet, multipliers: Array, options: CalibrationOptions) -> tuple[CameraStages, Mask]:
    """Fit f of every style, Ts and the unknown Tw of samples of one camera; black-and-white styles are left out.

    multipliers: (n, 3), guesses where the samples tell none. Returns the stages for all samples, and which (n,) a gamut
    map can be fitted to. Raises CalibrationError.
    """
    without = [name for name, style in style_data(samples, multipliers)[0].items() if style.monochrome]
    usable = unclipped(samples, multipliers) & ~np.isin(samples.style, without)
    if not usable.any():
        raise CalibrationError(
            f'style "{without[0]}" is black and white: its JPEGs hold no colour to fit the physical model to: '
            'use the "lattice" model, or add shots in another style'
        )
    inside, known = samples.select(usable), np.all(np.isfinite(samples.wb), axis=1)
    stages = fit_stages(inside, multipliers[usable], known[usable], options.preset, options.physical)
    completed = multipliers.copy()
    completed[usable] = stages.multipliers
    for setting in np.unique(samples.settings[~known]):
        rows = ~known & (samples.settings == setting)
        if (rows & usable).any():
            completed[rows] = completed[rows & usable][0]
    return replace(stages, multipliers=completed), usable


def stages_of(profile: CameraProfile, samples: SampleSet, multipliers: Array) -> tuple[CameraStages, Mask]:
    """Take the stages of a profile for samples with multipliers Tw (n, 3). Raises CalibrationError: it has none."""
    models = {name: style.physical[0] for name, style in profile.styles.items() if style.physical}
    responses = {name: model.response for name, model in models.items()}
    usable = unclipped(samples, multipliers) & np.isin(samples.style, list(responses))
    if not usable.any():
        raise CalibrationError(
            f"the given response and matrix are of the styles {', '.join(responses) or 'none'}; the samples are of "
            f"{', '.join(np.unique(samples.style))}"
        )
    return CameraStages(next(iter(models.values())).matrix, multipliers, responses), usable


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
    vignettings: tuple[Vignetting, ...]
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
            vignettings=self.vignettings,
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
    vignettings = () if thesis else fit_vignettings(samples, multipliers, unclipped(samples, multipliers))
    samples = at_the_centre(samples, vignettings)
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
    notes += [*(vignetting.note for vignetting in vignettings), *departure_notes(departures)]
    return PreparedSamples(samples, multipliers, raw_camera, transfer, vignettings, diagnoses, tuple(notes))


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
