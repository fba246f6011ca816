"""The file of a workspace: a zip of JSON, a sample table, marks and profiles; read with limits, not unpickled."""

import json
import shutil
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Mask
from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.boundary import opened_archive, read_entry, reading
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.evaluation import predict
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import read_samples
from lutforge.studio.models import BASE_MODEL, MODEL_TITLES, FitTask, FittedModel, ModelKind
from lutforge.studio.workspace import MOST_GROUPS, Workspace, WorkspaceError
from lutforge.thesis.options import stated_options

SUFFIX = ".workspace"
DOCUMENT = "workspace.json"
SAMPLES = "samples.npz"
MARKS = "marks.npy"


def save_workspace(workspace: Workspace, path: str | Path) -> None:
    """Write a workspace, atomically. Raises WorkspaceError on another suffix than .workspace."""
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise WorkspaceError(f"{path}: a workspace file ends in {SUFFIX}")
    if not workspace.has_raw:
        raise WorkspaceError("a bracket has no workspace: save its profile, and open the pictures again")
    groups = [{"name": name, "active": name not in workspace.inactive_groups} for name in workspace.groups]
    document = {
        "format": "lutforge-workspace", "version": 4, "limits": workspace.limits, "groups": groups,
        "models": list(workspace.models), "model": workspace.model, "options": workspace.options.as_json(),
        "out": sorted(workspace.left_out_shots), "unticked": sorted(workspace.unticked_pairs),
        "own_stages": workspace.builds_on_stages,
    }  # fmt: skip
    # A column for the marks of the hand, one for each group, and one for the rows that each model was fitted to.
    every = np.ones(len(workspace.samples), dtype=np.bool_)
    masks = [*workspace.groups.values()]
    masks += [every if model.task is None else model.task.rows for model in workspace.models.values()]
    marks = np.stack([workspace.hand_marks, *(mask.astype(np.int8) for mask in masks)], axis=1)
    with scratch_folder() as folder, atomic_path(path) as temporary:
        (folder / DOCUMENT).write_text(json.dumps(document, indent=1, ensure_ascii=False), encoding="utf-8")
        workspace.samples.save(folder / SAMPLES)
        np.save(folder / MARKS, marks, allow_pickle=False)
        for name, model in workspace.models.items():
            model.profile.save(folder / f"{name}.npz")
        with zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
            for file in sorted(folder.iterdir()):
                archive.write(file, file.name)


def open_workspace(path: str | Path) -> Workspace:
    """Read a workspace, without its exposure pairs, which follow from the samples. Raises WorkspaceError."""
    path = Path(path)
    with reading(path.name, "a LutForge workspace", WorkspaceError):
        with opened_archive(path, WorkspaceError) as archive, scratch_folder() as folder:
            document = _read_document(archive)
            samples = read_samples(_extract(archive, SAMPLES, folder))
            marks = np.load(_extract(archive, MARKS, folder), allow_pickle=False)
            profiles = {kind: load_profile(_extract(archive, f"{kind}.npz", folder)) for kind in document["models"]}
        entries = document["groups"]
        hand_marks, groups, fitted_rows = _columns_of(marks, len(entries), len(profiles))
        names = [str(entry["name"])[:60] for entry in entries]
        limits = {str(name): (float(low), float(high)) for name, (low, high) in document["limits"].items()}
        return Workspace(
            samples,
            limits=limits,
            hand_marks=hand_marks,
            groups=dict(zip(names, groups, strict=True)),
            inactive_groups=frozenset(name for name, entry in zip(names, entries, strict=True) if not entry["active"]),
            models=_models_of(profiles, fitted_rows, samples, bool(document["own_stages"])),
            model=document["model"],
            options=stated_options(document["options"]),
            left_out_shots=frozenset(map(str, document["out"])),
            unticked_pairs=frozenset((str(shot_a), str(shot_b)) for shot_a, shot_b in document["unticked"]),
            builds_on_stages=bool(document["own_stages"]),
        )


def _read_document(archive: zipfile.ZipFile) -> dict[str, Any]:
    """The JSON of a workspace file. Raises WorkspaceError where it is none that this version reads."""
    is_small = DOCUMENT in archive.namelist() and archive.getinfo(DOCUMENT).file_size <= 1 << 20
    document = json.loads(read_entry(archive, DOCUMENT)) if is_small else None
    if not isinstance(document, dict) or document.get("format") != "lutforge-workspace":
        raise WorkspaceError("not a LutForge workspace")
    if document.get("version") != 4:
        raise WorkspaceError(f"workspace version {document.get('version')}; this LutForge reads version 4")
    names_models = isinstance(document["model"], str) and set(document["models"]) <= set(MODEL_TITLES)
    if len(document["groups"]) > MOST_GROUPS or not names_models:
        raise WorkspaceError("it names models or groups that no workspace has")
    return document


def _columns_of(marks: NDArray[Any], groups: int, models: int) -> tuple[NDArray[np.int8], list[Mask], list[Mask]]:
    """The marks by hand (n,), the rows of each group, and those that each model was fitted to, as a file holds them.

    groups, models: how many there are. Raises WorkspaceError where the columns are of others.
    """
    if marks.dtype != np.int8 or marks.shape[1:] != (1 + groups + models,):
        raise WorkspaceError("damaged, its marks are not of its groups and models")
    masks = [column != 0 for column in marks.T[1:]]
    return marks[:, 0], masks[:groups], masks[groups:]


def _models_of(
    profiles: Mapping[ModelKind, CameraProfile], fitted_rows: Sequence[Mask], samples: SampleSet, builds_on_stages: bool
) -> dict[ModelKind, FittedModel]:
    """The models of a file, each with the task that it was fitted to."""
    models: dict[ModelKind, FittedModel] = {}
    for (kind, profile), rows in zip(profiles.items(), fitted_rows, strict=True):
        stages = models.get(BASE_MODEL) if builds_on_stages and kind != BASE_MODEL else None
        task = FitTask(kind, rows, stated_options(profile.options), stages)
        models[kind] = FittedModel(profile, predict(profile, samples), task=task)
    return models


def _extract(archive: zipfile.ZipFile, name: str, folder: Path) -> Path:
    """One entry into the folder, under our own name, no more than 4 GB of it."""
    if archive.getinfo(name).file_size > 4 << 30:
        raise WorkspaceError(f"refused, {name} in it is larger than any workspace's")
    with archive.open(name) as source, (folder / name).open("wb") as target:
        shutil.copyfileobj(source, target, 1 << 20)
    return folder / name
