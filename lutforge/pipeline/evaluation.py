"""Use case: a profile and samples → its errors."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from pathlib import Path

from lutforge.evaluation.evaluate import evaluate as evaluate_profile
from lutforge.evaluation.evaluation import Evaluation
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.sample_origin import require_same_origin
from lutforge.pipeline.sampling import as_samples
from lutforge.progress import Progress, silent, telling_of_compilation
from lutforge.samples.sample_set import SampleSet, with_setting_names


def evaluate(
    profile: CameraProfile | str | Path,
    samples: SampleSet | Paths,
    progress: Progress = silent,
    *,
    tables: bool = False,
    sizes: Sequence[int] = (13, 17, 24),
) -> Evaluation:
    """Measure the errors of a profile on samples, beside plain baselines.

    A shot that the profile was calibrated from is left out and predicted by a refit without it; any other is predicted
    by the profile as it is.

    Args:
        profile: a profile, or the path of its file.
        samples: a SampleSet, or what `sample` takes.
        progress: called with what is being done, and the share that is done.
        tables: every method of the thesis's error tables, with times.
        sizes: nodes per axis of the lattices of these tables.

    Returns:
        The errors as records; `evaluation.as_json()` is one document of them.

    Raises:
        CalibrationError: the samples hold none of the profile's styles, or are of RAW where it is not.
        ProfileError, SampleError, ShotError: a file cannot be read.
    """
    camera = as_profile(profile)
    samples = as_samples(samples)
    require_same_origin(camera, samples)
    with telling_of_compilation(progress) as telling:
        return evaluate_profile(camera, with_setting_names(samples), telling, tables=tables, sizes=sizes)
