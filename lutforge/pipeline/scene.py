"""Use case: shots beside a profile → what the camera did to them beyond its fixed rendering."""

from __future__ import annotations  # so that help() shows the names of types

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge.errors import CalibrationError
from lutforge.evaluation.evaluate import scene_departures
from lutforge.model.camera_profile import CameraProfile, as_profile
from lutforge.model.falloff import falloff_of
from lutforge.pipeline.outputs import Paths
from lutforge.pipeline.sampling import gather_samples
from lutforge.progress import Progress, silent
from lutforge.report.tables import Table
from lutforge.samples.sample_set import with_setting_names


@dataclass(frozen=True)
class SceneInspection:
    """What the camera did to shots beyond a profile's fixed rendering. table: a row a shot."""

    table: Table
    notes: tuple[str, ...]


def inspect_scene(profile: CameraProfile | str | Path, shots: Paths, progress: Progress = silent) -> SceneInspection:
    """Compare three shots or more with a profile's rendering: lens falloff, exposure, contrast, saturation.

    shots: RAW files, folders, or sample tables. Departures that chance explains are not told.
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
    return SceneInspection(Table(f"Beyond the rendering of {profile}", header, rows), gathered.left_out)
