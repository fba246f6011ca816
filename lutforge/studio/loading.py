"""What the studio opens: sample tables, shots and folders of them, profiles, and whole workspaces."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from lutforge.calibration.physical.exposure_pairs import ExposurePairs, pairs_of_samples
from lutforge.errors import CalibrationError, SampleError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.outputs import TABLE_SUFFIXES
from lutforge.pipeline.sampling import gather_samples
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.studio.fits import evaluate_on
from lutforge.studio.workspace import Workspace
from lutforge.studio.workspace_file import SUFFIX, open_workspace


@dataclass(frozen=True, eq=False)
class Opened:
    """What was opened. workspace: None where it was profiles alone; files: by shot its RAW file; notes: a line each."""

    workspace: Workspace | None
    profile: CameraProfile | None = None
    notes: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)


def open_paths(paths: tuple[Path, ...], progress: Progress) -> Opened:
    """A workspace; or samples, shots and folders together; or profiles, with samples beside them.

    Raises LutForgeError in one line.
    """
    if not paths:
        raise SampleError("nothing given: name a sample table (.csv, .parquet), RAW files, a folder, or a profile")
    if len(paths) == 1 and paths[0].suffix.lower() == SUFFIX:
        progress("reading", 0.0)
        return Opened(_with_pairs(open_workspace(paths[0])))
    profiles = [load_profile(path) for path in paths if path.suffix.lower() == ".npz"]
    profile = profiles[-1] if profiles else None
    sources = [path for path in paths if path.suffix.lower() != ".npz"]
    if not sources:
        return Opened(None, profile)
    sampled = gather_samples(sources, progress)
    progress("looking for exposure pairs", 0.95)
    workspace = _with_pairs(Workspace(sampled.samples))
    if profile is not None:
        workspace = with_profile(workspace, profile)
    notes = (*(account.summary for account in sampled.shots), *sampled.left_out)
    return Opened(workspace, profile, notes, sampled.files)


def with_profile(workspace: Workspace, profile: CameraProfile) -> Workspace:
    """With a profile as its fitted model, under the name of the model that it holds."""
    kind = "rbf" if profile.options.get("model") == "rbf" or not _has_lattice(profile) else "lattice"
    return workspace.with_model(kind, evaluate_on(profile, kind, workspace.samples))


def _has_lattice(profile: CameraProfile) -> bool:
    return any(style.render is not None for style in profile.styles.values())


def _with_pairs(workspace: Workspace) -> Workspace:
    return replace(workspace, pairs=find_pairs(workspace.samples))


def find_pairs(samples: SampleSet) -> ExposurePairs | None:
    """The exposure pairs, None where there are none."""
    try:
        return pairs_of_samples(with_setting_names(samples))
    except CalibrationError:
        return None


OPENED_SUFFIXES = (*TABLE_SUFFIXES, ".npz", SUFFIX)
