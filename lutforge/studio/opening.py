"""Opening files: paths inside the studio's folders; samples, shots, profiles and brackets."""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from lutforge.errors import CalibrationError, LutForgeError, ShotError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.file_kinds import PICTURE_SUFFIXES, TABLE_SUFFIXES
from lutforge.pipeline.response import Bracket, bracket_samples
from lutforge.pipeline.sampling import gather_samples
from lutforge.progress import Progress
from lutforge.samples.extract import ShotSamples
from lutforge.samples.table_file import is_table
from lutforge.shots.discover import JPEG_SUFFIXES, RAW_SUFFIXES, discover, raw_beside
from lutforge.shots.metadata import read_picture_settings
from lutforge.studio.workspace import SUFFIX, Workspace, find_pairs, open_workspace, with_profile

OPENED_SUFFIXES = (*TABLE_SUFFIXES, SUFFIX)


class FolderError(LutForgeError):
    """A path outside the folders that the studio was started with."""


class Folders:
    """Folders by name, resolved: symbolic links are followed before a path is judged."""

    def __init__(self, paths: Iterable[str | Path]) -> None:
        self.roots = tuple(dict.fromkeys(Path(path).resolve() for path in paths))
        for path in self.roots:
            if not path.is_dir():
                raise FolderError(f"{path}: not a folder; name a folder that exists")

    def inside(self, text: str) -> Path:
        """The resolved path that a visitor names, relative to the first folder. Raises FolderError outside of all."""
        shown = " ".join(text.split())[:200]
        if not shown:
            raise FolderError("no file named: write its path, or choose one from the list")
        if "\0" in text:
            raise FolderError(f"{shown}: not a path")
        try:
            path = (self.roots[0] / text.strip()).resolve()
        except (OSError, RuntimeError) as error:
            raise FolderError(f"{shown}: cannot be followed ({type(error).__name__}); name another path") from error
        if not self.holds(path):
            folders = ", ".join(map(str, self.roots))
            raise FolderError(f"{shown}: outside the folders of this studio ({folders}); start it with --folder")
        return path

    def holds(self, path: Path) -> bool:
        """Whether a resolved path lies in one of the folders."""
        return any(path.is_relative_to(root) for root in self.roots)

    def files(self, suffixes: Iterable[str]) -> list[str]:
        """Files with these suffixes in the folders and the folders in them, as a visitor may name them."""
        lower_suffixes = {suffix.lower() for suffix in suffixes}
        paths = (path for root in self.roots for pattern in ("*", "*/*") for path in sorted(root.glob(pattern)))
        shown = (path for path in paths if path.suffix.lower() in lower_suffixes and not path.name.startswith("."))
        names = (self.name(path) for path in shown if path.is_file() and self.holds(path.resolve()))
        return list(dict.fromkeys(islice(names, 500)))  # more would make a list that nobody reads

    def with_shots(self) -> list[str]:
        """The folders that hold RAW files, or at least two JPEGs of which none has any, as a visitor may name them."""
        kinds = (RAW_SUFFIXES, JPEG_SUFFIXES)
        raw, jpeg = ([(self.roots[0] / name).parent for name in self.files(kind)] for kind in kinds)
        return sorted(self.name(folder) for folder in {*raw, *(parent for parent in jpeg if jpeg.count(parent) > 1)})

    def name(self, path: Path) -> str:
        """A path as a visitor would name it: relative to the first folder where it lies there."""
        return str(path.relative_to(self.roots[0])) if path.is_relative_to(self.roots[0]) else str(path)


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
