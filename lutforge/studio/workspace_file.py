"""What the studio opens: sample tables, shots and folders of them, profiles, and whole workspaces.

A workspace is one file: a zip of JSON, a sample table, marks and profiles; read with limits, not unpickled.
"""

import json
import shutil
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.boundary import reading
from lutforge.calibration.options import options_from_json
from lutforge.calibration.physical.exposure_pairs import ExposurePairs, pairs_of_samples
from lutforge.errors import CalibrationError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.profile_file import save_profile
from lutforge.pipeline.outputs import TABLE_SUFFIXES
from lutforge.pipeline.predictions import predict
from lutforge.pipeline.sampling import gather_samples
from lutforge.progress import Progress
from lutforge.samples.extract import ShotSamples
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.samples.table import is_table, read_samples, write_samples
from lutforge.studio.brackets import Bracket, bracket_in
from lutforge.studio.workspace import MODELS, MOST_GROUPS, FitTask, FittedModel, Group, Workspace, WorkspaceError

SUFFIX = ".workspace"
DOCUMENT, SAMPLES, MARKS = "workspace.json", "samples.npz", "marks.npy"


def save_workspace(workspace: Workspace, path: str | Path) -> None:
    """Write a workspace, atomically. Raises WorkspaceError on another suffix than .workspace."""
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise WorkspaceError(f"{path}: a workspace file ends in {SUFFIX}")
    if not workspace.has_raw:
        raise WorkspaceError("a bracket has no workspace: save its profile, and open the pictures again")
    document = {
        "format": "lutforge-workspace",
        "version": 4,
        "limits": workspace.limits,
        "groups": [{"name": name, "active": group.active} for name, group in workspace.groups.items()],
        "models": list(workspace.models),
        "model": workspace.model,
        "options": workspace.options.as_json(),
        "out": sorted(workspace.out),
        "unticked": sorted(workspace.unticked),
        "own_stages": workspace.own_stages,
    }
    # A column for the marks of the hand, one for each group, and one for the rows that each model was fitted to.
    every = np.ones(len(workspace.samples), dtype=np.bool_)
    masks = [group.rows for group in workspace.groups.values()]
    masks += [every if model.task is None else model.task.rows for model in workspace.models.values()]
    marks = np.stack([workspace.hand, *(mask.astype(np.int8) for mask in masks)], axis=1)
    with (
        scratch_folder() as folder,
        atomic_path(path) as temporary,
        zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive,
    ):
        archive.writestr(DOCUMENT, json.dumps(document, indent=1, ensure_ascii=False))
        write_samples(folder / SAMPLES, workspace.samples)
        np.save(folder / MARKS, marks, allow_pickle=False)
        for name, model in workspace.models.items():
            save_profile(model.profile, folder / f"{name}.npz")
        for name in (SAMPLES, MARKS, *(f"{name}.npz" for name in workspace.models)):
            archive.write(folder / name, name)


def open_workspace(path: str | Path) -> Workspace:
    """Read a workspace, without its exposure pairs, which follow from the samples. Raises WorkspaceError."""
    path = Path(path)
    with reading(path.name, "a LutForge workspace", WorkspaceError):
        with zipfile.ZipFile(path) as archive, scratch_folder() as folder:
            document = _document(archive)
            samples = read_samples(_extract(archive, SAMPLES, folder))
            marks = _marks(np.load(_extract(archive, MARKS, folder), allow_pickle=False), document)
            profiles = {name: load_profile(_extract(archive, f"{name}.npz", folder)) for name in document["models"]}
        groups = {
            str(entry["name"])[:60]: Group(marks[:, index] != 0, bool(entry["active"]))
            for index, entry in enumerate(document["groups"], start=1)
        }
        models: dict[str, FittedModel] = {}
        for index, (name, profile) in enumerate(profiles.items(), start=1 + len(groups)):
            stages = models.get("matrix") if document["own_stages"] and name != "matrix" else None
            task = FitTask(name, marks[:, index] != 0, options_from_json(profile.options), stages)
            models[name] = FittedModel(profile, predict(profile, samples), task=task)
        return Workspace(
            samples, limits={str(name): (float(low), float(high)) for name, (low, high) in document["limits"].items()},
            hand=marks[:, 0], groups=groups, models=models,
            model=str(document["model"]), options=options_from_json(document["options"]),
            out=frozenset(map(str, document["out"])), own_stages=bool(document["own_stages"]),
            unticked=frozenset((str(one), str(other)) for one, other in document["unticked"]),
        )  # fmt: skip


def _document(archive: zipfile.ZipFile) -> dict[str, Any]:
    if DOCUMENT not in archive.namelist() or archive.getinfo(DOCUMENT).file_size > 1 << 20:
        raise WorkspaceError("not a LutForge workspace")
    document = json.loads(archive.read(DOCUMENT))
    if not isinstance(document, dict) or document.get("format") != "lutforge-workspace":
        raise WorkspaceError("not a LutForge workspace")
    if document.get("version") != 4:
        raise WorkspaceError(f"workspace version {document.get('version')}; this LutForge reads version 4")
    if len(document["groups"]) > MOST_GROUPS or not set(document["models"]) <= set(MODELS):
        raise WorkspaceError("it names models or groups that no workspace has")
    return document


def _extract(archive: zipfile.ZipFile, name: str, folder: Path) -> Path:
    """One entry into the folder, under our own name, no more than 4 GB of it."""
    if archive.getinfo(name).file_size > 4 << 30:
        raise WorkspaceError(f"refused, {name} in it is larger than any workspace's")
    with archive.open(name) as source, (folder / name).open("wb") as target:
        shutil.copyfileobj(source, target, 1 << 20)
    return folder / name


def _marks(marks: NDArray[Any], document: dict[str, Any]) -> NDArray[np.int8]:
    if marks.dtype != np.int8 or marks.ndim != 2 or marks.shape[1] != 1 + len(document["groups"] + document["models"]):
        raise WorkspaceError("damaged, its marks are not of its groups and models")
    return np.ascontiguousarray(marks)


@dataclass(frozen=True, eq=False)
class Opened:
    """What was opened.

    workspace: None where it was profiles alone; profile_source: the file of the profile; accounts: of shots; left_out:
    why other shots have none; files: by shot its RAW file; bracket: pictures without RAW, where that is all.
    """

    workspace: Workspace | None = None
    profile: CameraProfile | None = None
    accounts: tuple[ShotSamples, ...] = ()
    left_out: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)
    profile_source: Path | None = None
    bracket: Bracket | None = None


def open_paths(paths: tuple[Path, ...], progress: Progress) -> Opened:
    """A workspace; or samples, shots and folders together; or profiles, with samples beside them.

    Raises LutForgeError in one line.
    """
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
        shown = None if bracket.samples is None else Workspace(bracket.samples, bracket.pairs)
        return Opened(shown, bracket=bracket)
    sampled = gather_samples(sources, progress)
    progress("looking for exposure pairs", 0.95)
    workspace = Workspace(sampled.samples, find_pairs(sampled.samples))
    if profile is not None:
        workspace = with_profile(workspace, profile)
    return Opened(workspace, profile, sampled.shots, sampled.left_out, sampled.files, source)


def with_profile(workspace: Workspace, profile: CameraProfile) -> Workspace:
    """Add a profile as the fitted model, under the name of the model that it holds."""
    has_lattice = any(style.render is not None for style in profile.styles.values())
    kind = "lattice" if has_lattice and profile.options.get("model") != "rbf" else "rbf"
    return workspace.with_model(kind, FittedModel(profile, predict(profile, workspace.samples)))


def find_pairs(samples: SampleSet) -> ExposurePairs | None:
    """The exposure pairs, None where there are none."""
    try:
        return pairs_of_samples(with_setting_names(samples))
    except CalibrationError:
        return None


OPENED_SUFFIXES = (*TABLE_SUFFIXES, SUFFIX)
