"""From samples to a camera profile: the stages of the calibration in order."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lutforge.arrays import Array
from lutforge.calibration.lattice.bake import node_coverage
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.white_balance import named_white_balances
from lutforge.calibration.preparation import prepare
from lutforge.calibration.shots.thin_samples import thin_colours, thin_settings
from lutforge.calibration.stages import base_of, fit_camera_stages, stages_of
from lutforge.calibration.style_data import StyleData, style_data
from lutforge.calibration.style_fit import fit_lattices
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PhysicalModel, PictureStyle
from lutforge.progress import Progress, silent
from lutforge.samples.sample_set import SampleSet
from lutforge.solvers.blas import one_blas_thread
from lutforge.threads import each


@dataclass(frozen=True, eq=False)
class CalibratedStyle:
    """The data of one style, and the style as the profile has it, without held-out errors."""

    data: StyleData
    picture: PictureStyle


@dataclass(frozen=True, eq=False)
class Calibration:
    """A fitted profile without held-out errors, and the data that these are measured with.

    styles: by style name.
    """

    profile: CameraProfile
    styles: Mapping[str, CalibratedStyle] = field(default_factory=dict)


@one_blas_thread
def calibrate(
    samples: SampleSet,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    stages: CameraProfile | None = None,
) -> Calibration:
    """Fit the white balances, the matrix and, per style, the camera model and the lattices that are its fast form.

    stages: a profile whose responses, matrix and white balances are taken as they are (`calibrate_stages`). Raises
    CalibrationError, in one line with what to do, where the samples do not determine the models.
    """
    options = options or CalibrationOptions()
    progress("checking white balances and shots", 0.0)
    prepared = prepare(samples, options, stages)
    samples, multipliers = prepared.samples, prepared.multipliers
    physical: Mapping[str, PhysicalModel] = {}
    matrix = None if stages is None else stages.matrix
    if options.model == "rbf":
        progress("response, matrix and white balances", 0.0)
        if stages is None:
            fitted = fit_camera_stages(samples, multipliers, options)
        else:
            fitted = stages_of(stages, samples, multipliers)
        multipliers = fitted.multipliers
        if options.preset == "thesis":
            physical = {name: maps.model for name, maps in fitted.maps(samples, options).items()}
            matrix = fitted.matrix if matrix is None else matrix
    data, clipped = style_data(samples, multipliers)
    data = {name: replace(style, most_centres=options.physical.centres) for name, style in data.items()}
    if stages is not None:
        data = {name: replace(style, given=base_of(stages, name)) for name, style in data.items()}
    styles = _fit_styles(data, physical, options, progress)
    progress("done", 1.0)
    if matrix is None:
        matrix = _matrix_of_most(styles)
    if stages is None:
        matrix = matrix / matrix.sum(axis=1, keepdims=True)
    balances = named_white_balances(samples, multipliers, matrix)
    presets = [name for name in balances if name not in samples.white_balance]
    profile = prepared.profile(
        matrix,
        balances,
        {name: style.picture for name, style in styles.items()},
        options,
        (*_weaknesses(samples, data, clipped), *_computed(presets)),
    )
    return Calibration(profile, styles)


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
    stages = fit_camera_stages(prepared.samples, prepared.multipliers, options)
    balances = named_white_balances(prepared.samples, stages.multipliers, stages.matrix)
    progress("done", 1.0)
    matrix = stages.matrix / stages.matrix.sum(axis=1, keepdims=True)
    return prepared.profile(matrix, balances, stages.styles(tuple(balances)), options)


def _computed(presets: Sequence[str]) -> list[str]:
    """A note on white balances that no shot was taken with."""
    if not presets:
        return []
    return [f"white balances {', '.join(presets)} are computed by the camera's matrix: no shot was taken with them"]


def _weaknesses(samples: SampleSet, data: Mapping[str, StyleData], clipped: int) -> list[str]:
    """Notes on settings and colours with few samples."""
    notes = [*thin_settings(samples)]
    if clipped:
        notes.append(f"{clipped} of {len(samples)} samples are clipped and take no part in the fit")
    for name, style in data.items():
        notes += thin_colours(style.encoded, name, monochrome=style.monochrome)
    return notes


def _fit_styles(
    data: Mapping[str, StyleData],
    physical: Mapping[str, PhysicalModel],
    options: CalibrationOptions,
    progress: Progress,
) -> dict[str, CalibratedStyle]:
    """Fit several styles beside each other. physical: models of styles that are fitted already."""

    def fitted(name: str) -> CalibratedStyle:
        style = data[name]
        lattices = fit_lattices(style, options)
        coverage = {direction: node_coverage(one, style.both[direction][0]) for direction, one in lattices.items()}
        own = () if style.monochrome or options.preset == "thesis" else (style.model,)
        models = (physical[name],) if name in physical else own
        return CalibratedStyle(style, PictureStyle(lattices.render, lattices.linearize, models, coverage=coverage))

    progress(f"fitting {', '.join(data)}", 0.0)
    styles = {}
    for name, style in zip(data, each(fitted, list(data)), strict=True):
        styles[name] = style
        progress(f"{name}: fitted", len(styles) / len(data))
    return styles


def _matrix_of_most(styles: Mapping[str, CalibratedStyle]) -> Array:
    """Ts of the style with most samples; the identity where all styles are black and white."""
    coloured = [style for style in styles.values() if not style.data.monochrome]
    return max(coloured, key=lambda style: len(style.data.shot)).data.unsaturated.matrix if coloured else np.eye(3)
