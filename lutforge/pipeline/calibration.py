"""Use case: samples → a camera profile."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.raw_transfer import fit_raw_transfer, pair_samples
from lutforge.colour.rgb_spaces import matrix_between
from lutforge.errors import CalibrationError, SampleError
from lutforge.evaluation.measured_profile import measured
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.provenance import Pictures
from lutforge.model.raw_transfer import RawTransfer
from lutforge.pipeline.outputs import Paths, check_output
from lutforge.pipeline.provenance import provenance_of
from lutforge.pipeline.sampling import SampledShots, as_samples, gather_samples
from lutforge.progress import Progress, part, silent, with_compilation
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.thesis.method import method_of
from lutforge.thesis.options import Options


def calibrate(
    samples: SampleSet | Paths,
    options: Options | None = None,
    progress: Progress = silent,
    *,
    given: CameraProfile | str | Path | None = None,
) -> CameraProfile:
    """Calibrate a camera: fit its matrix, white balances and picture styles to samples, with held-out errors.

    Args:
        samples: a SampleSet, or what `sample` takes: tables, RAW files, folders. RAW is linear before white balance,
            JPEG values are encoded, both in [0, 1].
        options: CalibrationOptions, such as the size of the lattices; or lutforge.thesis.options.ThesisOptions, for
            the thesis's method.
        progress: called with the name of the present step, and the share that is done.
        given: a profile whose responses, matrix and white balances are used in place of fitted ones.

    Returns:
        The profile, with its notes and held-out errors; `profile.save(path)` writes it.

    Raises:
        CalibrationError: the samples do not determine the model.
        SampleError, ShotError: the samples cannot be read.
    """
    if options is not None and not isinstance(options, Options):
        raise CalibrationError(f"{options!r:.80} are no options: give CalibrationOptions(size=33), or none")
    options = options or CalibrationOptions()
    samples = with_setting_names(as_samples(samples))
    provenance = provenance_of(samples)
    with with_compilation(progress) as reporting:
        base = None if given is None else as_profile(given)
        fitted, data = method_of(options).calibrate(samples, part(reporting, 0.0, 0.5), base)
        profile = measured(fitted, data, options, part(reporting, 0.5, 1.0))
    if not isinstance(provenance, Pictures):
        return profile
    # The matrix of pictures, and of a chart's colours, is known exactly: that of their colour space.
    return replace(profile, matrix=matrix_between(provenance.space, "linear-srgb"), provenance=provenance)


def calibrate_base(
    samples: SampleSet | Paths, options: Options | None = None, progress: Progress = silent
) -> CameraProfile:
    """Fit responses, matrices and white balances only, as `given` of `calibrate`; the gamut maps are the identity."""
    samples = with_setting_names(as_samples(samples))
    with with_compilation(progress) as reporting:
        return method_of(options or CalibrationOptions()).calibrate_base(samples, reporting)


def write_transfer(
    source: Path,
    target: Path,
    output: Path,
    progress: Progress = silent,
    report_shots: Callable[[SampledShots], None] = lambda sampled: None,
) -> tuple[int, RawTransfer]:
    """Fit the transfer from the RAW of one camera to that of another, and write it (.json).

    source, target: samples, RAW files or folders of one camera each. report_shots: called with those of each camera.
    Returned are the number of colours that both cameras photographed, and the transfer. Raises SampleError,
    CalibrationError.
    """
    check_output(output, (".json",), (source, target))
    sample_sets = []
    names = []
    for path, share in ((source, 0.0), (target, 0.5)):
        sampled = gather_samples(path, part(progress, share, share + 0.5))
        report_shots(sampled)
        cameras = sorted(set(sampled.samples.camera.tolist()))
        if len(cameras) != 1:
            raise SampleError(f"{path}: samples of several cameras; give those of one")
        sample_sets.append(sampled.samples)
        names.append(str(cameras[0]))

    x, y, neutral = pair_samples(*sample_sets)
    fitted = fit_raw_transfer(names[0], names[1], x, y, neutral)
    if fitted.error is not None and fitted.error > 0.3:  # a larger error than that of any pair of cameras
        raise CalibrationError(
            f"{len(x)} colours that should be common differ by {fitted.error:.0%} after the best transfer: the "
            "shots are not of the same scenes; photograph the same charts with both cameras"
        )
    fitted.save(output)
    return len(x), fitted
