"""Opening files: workspaces, samples, shots, profiles and brackets."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.errors import CalibrationError, ShotError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.file_kinds import PICTURE_SUFFIXES, TABLE_SUFFIXES
from lutforge.pipeline.response import Bracket, bracket_samples
from lutforge.pipeline.sampling import gather_samples
from lutforge.progress import Progress
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.samples.table_file import is_table
from lutforge.shots.discover import discover, raw_beside
from lutforge.shots.metadata import read_picture_settings
from lutforge.studio.workspace import Workspace, with_profile
from lutforge.studio.workspace_file import SUFFIX, open_workspace

OPENED_SUFFIXES = (*TABLE_SUFFIXES, SUFFIX)


@dataclass(frozen=True, eq=False)
class Opened:
    """The contents of files that were opened.

    workspace: None where there are no samples; profile_source: the file of the profile; accounts: of shots; left_out:
    why other shots have none; bracket: pictures without RAW, where that is all.
    """

    workspace: Workspace | None = None
    profile: CameraProfile | None = None
    accounts: tuple[ShotSamples, ...] = ()
    left_out: tuple[str, ...] = ()
    profile_source: Path | None = None
    bracket: Bracket | None = None


def bracket_in(sources: Sequence[Path], progress: Progress) -> Opened | None:
    """Return the pictures that files and folders hold; None where there is anything else, such as RAW files, or one."""
    folders = [path for path in sources if path.is_dir()]
    with suppress(ShotError):
        if folders and discover(folders):
            return None
    files = [file for path in sources for file in (sorted(path.iterdir()) if path.is_dir() else [path])]
    if any(file in sources and file.suffix.lower() not in PICTURE_SUFFIXES for file in files):
        return None
    files = [file for file in files if file.suffix.lower() in PICTURE_SUFFIXES and raw_beside(file) is None]
    if len(files) < 2:
        return None
    settings = [read_picture_settings(file) for file in files]
    times = tuple(of_file.exposure for of_file in settings)
    camera = settings[0].camera
    workspace = None
    with suppress(CalibrationError):  # which Fit response then tells, with what to do
        workspace = Workspace(*bracket_samples(files, times, camera, progress))
    return Opened(workspace, bracket=Bracket(tuple(files), times, camera))


def open_paths(paths: tuple[Path, ...], progress: Progress) -> Opened:
    """Open a workspace; or samples, shots and folders together; or profiles, with or without samples."""
    if len(paths) == 1 and paths[0].suffix.lower() == SUFFIX:
        progress("reading", 0.0)
        workspace = open_workspace(paths[0])
        return Opened(replace(workspace, pairs=find_pairs(workspace.samples)))
    profiles = [path for path in paths if path.suffix.lower() == ".npz" and not is_table(path)]
    source = profiles[-1] if profiles else None
    profile = None if source is None else load_profile(source)
    sources = [path for path in paths if path not in profiles]
    if not sources:
        return Opened(profile=profile, profile_source=source)
    if (bracket := bracket_in(sources, progress)) is not None:
        return bracket
    sampled = gather_samples(sources, progress)
    progress("looking for exposure pairs", 0.95)
    workspace = Workspace(sampled.samples, find_pairs(sampled.samples))
    if profile is not None:
        workspace = with_profile(workspace, profile)
    return Opened(workspace, profile, sampled.shots, sampled.left_out, source)


def find_pairs(samples: SampleSet) -> ExposurePairs | None:
    """The exposure pairs, None where there are none."""
    with suppress(CalibrationError):
        return pairs_of_samples(with_setting_names(samples))
    return None
