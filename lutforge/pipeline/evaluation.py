"""Use case: a profile and samples → its errors."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from pathlib import Path

from lutforge.evaluation.evaluate import evaluate as evaluate_profile
from lutforge.evaluation.evaluation import Evaluation
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.sample_origin import require_same_origin
from lutforge.pipeline.sampling import gather_samples
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
    by the profile as it is. tables: every method of the thesis's error tables, with times; sizes: nodes
    per axis of its lattices.
    Raises CalibrationError where the samples hold none of the profile's styles, or are of RAW where it is not.
    """
    camera = as_profile(profile)
    if not isinstance(samples, SampleSet):
        samples = gather_samples(samples).samples
    require_same_origin(camera, samples)
    with telling_of_compilation(progress) as telling:
        return evaluate_profile(camera, with_setting_names(samples), telling, tables=tables, sizes=sizes)
