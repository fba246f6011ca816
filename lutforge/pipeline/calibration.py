"""Use case: samples → a camera profile."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import replace
from pathlib import Path
from typing import cast

from lutforge.calibration.calibrate import calibrate as fit_profile
from lutforge.calibration.calibrate import calibrate_stages as fit_stages
from lutforge.calibration.options import CalibrationOptions, Preset
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.errors import CalibrationError
from lutforge.evaluation.measured_profile import measured
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

    Args:
        samples: a SampleSet, or what `sample` takes: tables, RAW files, folders. RAW is linear before white balance,
            JPEG values are encoded, both in [0, 1].
        options: model, preset, size of the lattices.
        progress: called with what is being done, and the share that is done.
        stages: a profile whose responses, matrix and white balances are taken as they are.

    Returns:
        The profile, with its notes and held-out errors; `profile.save(path)` writes it.

    Raises:
        CalibrationError: the samples do not determine the model.
        SampleError, ShotError: the samples cannot be read.
    """
    if options is not None and not isinstance(options, CalibrationOptions):
        raise CalibrationError(f"{options!r:.80} are no options: give CalibrationOptions(size=33), or none")
    options = options or CalibrationOptions()
    samples = with_setting_names(as_samples(samples))
    origin = origin_of(samples)
    with telling_of_compilation(progress) as telling:
        given = None if stages is None else as_profile(stages)
        fitted = fit_profile(samples, options, part(telling, 0.0, 0.5), given)
        profile = measured(fitted, options, part(telling, 0.5, 1.0))
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


def calibration_options(
    model: str, preset: str, size: int | None, interpolation: str, nonuniform: bool
) -> CalibrationOptions:
    """Return the options that a command's words ask for. Raises CalibrationError on unknown or contradictory words."""
    options = CalibrationOptions(
        model=cast(ModelName, model),
        preset=cast(Preset, preset),
        interpolation=cast(Interpolation, interpolation),
        nonuniform=nonuniform,
    )
    return options if size is None else replace(options, size=size)
