"""Use case: a profile and samples → its errors."""

from __future__ import annotations  # so that help() shows the names of types

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluate import evaluate as evaluate_profile
from lutforge.evaluation.evaluate import scene_departures
from lutforge.evaluation.evaluation import Evaluation
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.falloff import falloff_of
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.sample_origin import require_same_origin
from lutforge.pipeline.sampling import as_samples, gather_samples
from lutforge.progress import Progress, silent, telling_of_compilation
from lutforge.report.tables import Table
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


# --- What a camera did to shots beyond its profile's fixed rendering -------------------------------------------------


def inspect_scene(
    profile: CameraProfile | str | Path, shots: Paths, progress: Progress = silent
) -> tuple[Table, tuple[str, ...]]:
    """Compare three shots or more with a profile's rendering: lens falloff, exposure, contrast, saturation.

    shots: RAW files, folders, or sample tables. Departures that chance explains are not told. Returned are a table
    with a row a shot, and a line for each shot that was left out.
    Raises CalibrationError where the shots hold none of the profile's styles.
    """
    camera = as_profile(profile)
    gathered = gather_samples(shots, progress)
    samples = with_setting_names(gathered.samples)
    known = np.isin(samples.style, list(camera.styles))
    if not known.any():
        raise CalibrationError(
            f"the shots' styles ({', '.join(np.unique(samples.style))}) are not in the profile "
            f"({', '.join(camera.styles)})"
        )
    samples = samples.select(known)
    departures = {departure.shot: departure.cells for departure in scene_departures(camera, samples)}
    rows = []
    for name, shot in samples.by_shot():
        falloff = falloff_of(camera.falloffs, str(shot.lens[0]), float(shot.focal_mm[0]), float(shot.aperture[0]))
        corners = "–" if falloff is None else f"{falloff.corner_ev:+.2f} EV"
        rows.append((name, corners, *departures.get(name, ("–",) * 3)))
    header = ("shot", "corners", "exposure, EV", "contrast", "saturation")
    return Table(f"Beyond the rendering of {profile}", header, rows), gathered.left_out
