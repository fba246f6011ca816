"""Use case: samples → a camera profile. Also the smallest sufficient lattice, and the error by number of shots."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import replace
from pathlib import Path
from typing import cast

from lutforge.calibration.calibrate import calibrate as fit_profile
from lutforge.calibration.calibrate import calibrate_stages as fit_stages
from lutforge.calibration.options import CalibrationOptions, PhysicalOptions, Preset
from lutforge.calibration.preparation import data_by_style
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.errors import CalibrationError
from lutforge.evaluation.learning_curve import LearningCurve, learning_curve
from lutforge.evaluation.measured_profile import measured_and_shrunk
from lutforge.evaluation.size_search import smallest_size as find_smallest_size
from lutforge.interpolation import Interpolation
from lutforge.model.camera_profile import CameraProfile, ModelName, as_profile
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.sample_origin import origin_of
from lutforge.pipeline.sampling import as_samples
from lutforge.progress import Progress, part, silent, telling_of_compilation
from lutforge.samples.sample_set import SampleSet, with_setting_names


def calibrate(
    samples: SampleSet | Paths,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
    *,
    stages: CameraProfile | str | Path | None = None,
) -> CameraProfile:
    """Calibrate a camera: fit its matrix, white balances and picture styles to samples, with held-out errors.

    samples: a SampleSet, or what `sample` takes: tables, RAW files, folders. RAW is linear before white balance, JPEG
    values are encoded, both in [0, 1]. options: model, preset, size of the lattices; see CalibrationOptions.
    progress: called with what is being done and the share that is done. stages: a profile whose responses, matrix and
    white balances are taken as they are, such as `calibrate_stages` fits.
    Raises CalibrationError where the samples do not determine the model, SampleError or ShotError where they cannot be
    read.
    """
    options = options or CalibrationOptions()
    samples = with_setting_names(as_samples(samples))
    origin = origin_of(samples)
    with telling_of_compilation(progress) as telling:
        given = None if stages is None else as_profile(stages)
        fitted = fit_profile(samples, options, part(telling, 0.0, 0.5), given)
        profile = measured_and_shrunk(fitted, options, part(telling, 0.5, 1.0))
    if not origin:
        return profile
    exact = matrix_between(origin["raw_space"], "linear-srgb")  # of what a program developed nothing is to be fitted
    return replace(profile, matrix=exact, options={**profile.options, **origin})


def calibrate_stages(
    samples: SampleSet | Paths, options: CalibrationOptions | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit responses, matrix and white balances alone, as to the inliers of the samples that `calibrate` then gets.

    Returns a profile whose gamut maps change nothing. Raises CalibrationError where the samples do not determine them.
    """
    samples = with_setting_names(as_samples(samples))
    with telling_of_compilation(progress) as telling:
        return fit_stages(samples, options, telling)


def smallest_size(
    samples: SampleSet | Paths,
    tolerance: float,
    options: CalibrationOptions | None = None,
    progress: Progress = silent,
) -> int:
    """Find the nodes per axis of the smallest lattice that renders held-out shots within a mean error.

    tolerance: the mean norm of the RGB difference of encoded values, 1 = full scale; 0.0068 is one code of 255.
    Raises CalibrationError where no size reaches it, or no shot can be held out.
    """
    data = data_by_style(with_setting_names(as_samples(samples)))
    with telling_of_compilation(progress) as telling:
        return find_smallest_size(data, tolerance, options, telling)


def calibration_options(
    model: str,
    preset: str,
    size: int | None,
    tolerance: float | None,
    interpolation: str,
    nonuniform: bool,
    physical: PhysicalOptions | None = None,
) -> CalibrationOptions:
    """Return the options that a command's words ask for. Raises CalibrationError on unknown or contradictory words."""
    if size is not None and tolerance is not None:
        raise CalibrationError("give --size or --tolerance, not both")
    options = CalibrationOptions(
        model=cast(ModelName, model),
        preset=cast(Preset, preset),
        interpolation=cast(Interpolation, interpolation),
        nonuniform=nonuniform,
        physical=physical or PhysicalOptions(),
    )
    return options if size is None else replace(options, size=size)


def pair_of_shots(word: str) -> tuple[str, str]:
    """Two names of shots, of "SHOT|SHOT". Raises CalibrationError."""
    names = word.split("|")
    if len(names) != 2:
        raise CalibrationError(f'"{word[:60]}" names no two shots: write SHOT|SHOT')
    return names[0], names[1]


def learning_curves(samples: SampleSet | Paths, progress: Progress = silent) -> dict[str, LearningCurve]:
    """Measure, by style, the error on held-out shots against the number of shots calibrated from.

    Raises CalibrationError where no shot can be held out.
    """
    data = data_by_style(with_setting_names(as_samples(samples)))
    return {
        name: learning_curve(style, progress=part(progress, index / len(data), (index + 1) / len(data), name))
        for index, (name, style) in enumerate(data.items())
    }
