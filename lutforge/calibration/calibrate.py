"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.physical_model import GamutMaps
from lutforge.calibration.physical.white_balance import named_white_balances
from lutforge.calibration.preparation import prepare
from lutforge.calibration.shots.thin_samples import thin_colours, thin_settings
from lutforge.calibration.stages import base_of, fit_camera_stages, stages_of
from lutforge.calibration.style_data import StyleData, style_data
from lutforge.calibration.style_fit import StyleFit, fit_style, render_with_plain
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.directions import DIRECTIONS
from lutforge.model.profile_data import PictureStyle
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread
from lutforge.threads import each


@dataclass(frozen=True, eq=False)
class CalibratedStyle:
    """The data of one style, the fits to it, and the style as the profile has it.

    maps: the fit of the physical model, where that was asked for.
    """

    data: StyleData
    fit: StyleFit
    maps: GamutMaps | None
    picture: PictureStyle


@dataclass(frozen=True, eq=False)
class Calibration:
    """A fitted profile without held-out errors, and the data and fits that these are measured with.

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
    stages: a profile whose responses, matrix and white balances are taken as they are (`calibrate_stages`). Raises
    CalibrationError, in one line with what to do, where the samples do not determine the models.
    """
    options = options or CalibrationOptions()
    progress("checking white balances and shots", 0.0)
    prepared = prepare(samples, options, stages)
    samples, multipliers = prepared.samples, prepared.multipliers
    physical, maps = None, dict[str, GamutMaps]()
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        if stages is None:
            physical = fit_camera_stages(samples, multipliers, options)
        else:
            physical = stages_of(stages, samples, multipliers)
        maps = physical.maps(samples, options)
        multipliers = physical.multipliers
    data, clipped = style_data(samples, multipliers)
    if stages is not None:
        data = {name: replace(style, given=base_of(stages, name)) for name, style in data.items()}
    styles = _fit_styles(data, maps, options, progress)
    progress("done", 1.0)
    matrix = _matrix_of_most(styles) if physical is None else physical.matrix
    matrix = matrix / matrix.sum(axis=1, keepdims=True) if stages is None else stages.matrix
    profile = prepared.profile(
        matrix,
        named_white_balances(samples, multipliers, matrix),
        {name: style.picture for name, style in styles.items()},
        options,
        tuple(_weaknesses(samples, data, clipped)),
    )
    return Calibration(profile, styles)


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
    stages = fit_camera_stages(prepared.samples, prepared.multipliers, options)
    balances = named_white_balances(prepared.samples, stages.multipliers, stages.matrix)
    progress("done", 1.0)
    matrix = stages.matrix / stages.matrix.sum(axis=1, keepdims=True)
    return prepared.profile(matrix, balances, stages.styles(tuple(balances)), options)


def _weaknesses(samples: SampleSet, data: Mapping[str, StyleData], clipped: int) -> list[str]:
    """Notes on settings and colours with few samples."""
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

    The prior means that the held-out errors need are fitted at the same time, on processors that would be idle.
    """

    def fitted(name: str) -> CalibratedStyle:
        style, physical = data[name], maps.get(name)
        fit = fit_style(style, options)
        picture = PictureStyle(
            render=render_with_plain(style, fit, options),
            linearize=fit.linearize.lattice,
            physical=() if physical is None else (physical.model,),
            coverage={direction: found.coverage for direction, found in fit.items()},
        )
        return CalibratedStyle(style, fit, physical, picture)

    def prepare(fold: StyleData) -> None:
        with suppress(CalibrationError):  # the refit without these shots reports it
            for direction in DIRECTIONS if options.model == "lattice" else ():
                fold.prior_mean(options.size, direction)

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
    """Ts of the style with most samples; the identity where all styles are black and white."""
    coloured = [style for style in styles.values() if not style.data.monochrome]
    return max(coloured, key=lambda style: len(style.data.shot)).fit.base.matrix if coloured else np.eye(3)
