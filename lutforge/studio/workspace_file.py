"""A whole workspace as one file: a zip of JSON, a sample table, marks and profiles; read with limits, not unpickled."""

import json
import shutil
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.calibration.options import options_from_json
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import load_profile
from lutforge.model.profile_file import save_profile
from lutforge.samples.table import read_samples, write_samples
from lutforge.studio.fits import evaluate_on
from lutforge.studio.workspace import MODELS, MOST_GROUPS, Filters, Group, Workspace, WorkspaceError

SUFFIX = ".workspace"
DOCUMENT, SAMPLES, MARKS = "workspace.json", "samples.parquet", "marks.npy"


def save_workspace(workspace: Workspace, path: str | Path) -> None:
    """Write a workspace, atomically. Raises WorkspaceError on another suffix than .workspace."""
    path = Path(path)
    if path.suffix.lower() != SUFFIX:
        raise WorkspaceError(f"{path}: a workspace file ends in {SUFFIX}")
    document = {
        "format": "lutforge-workspace",
        "version": 1,
        "filters": vars(workspace.filters),
        "groups": [{"name": name, "active": group.active} for name, group in workspace.groups.items()],
        "models": list(workspace.models),
        "model": workspace.model,
        "options": workspace.options.as_json(),
    }
    # A column for the marks of the hand, one for each group, and one for the rows that each model was fitted to.
    every = np.ones(len(workspace.samples), dtype=np.bool_)
    masks = [group.rows for group in workspace.groups.values()]
    masks += [every if model.rows is None else model.rows for model in workspace.models.values()]
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
    try:
        with zipfile.ZipFile(path) as archive, scratch_folder() as folder:
            document = _document(archive)
            samples = read_samples(_extract(archive, SAMPLES, folder))
            marks = _marks(np.load(_extract(archive, MARKS, folder), allow_pickle=False), document)
            profiles = {name: load_profile(_extract(archive, f"{name}.npz", folder)) for name in document["models"]}
        groups = {
            str(entry["name"])[:60]: Group(marks[:, index] != 0, bool(entry["active"]))
            for index, entry in enumerate(document["groups"], start=1)
        }
        return Workspace(
            samples,
            filters=Filters(**document["filters"]),
            hand=marks[:, 0],
            groups=groups,
            models={
                name: replace(evaluate_on(profile, name, samples), rows=marks[:, index] != 0)
                for index, (name, profile) in enumerate(profiles.items(), start=1 + len(groups))
            },
            model=str(document["model"]),
            options=options_from_json(document["options"]),
        )
    except LutForgeError as error:
        raise WorkspaceError(f"{path.name}: {error}") from error
    except OSError as error:
        raise WorkspaceError(f"{path.name}: cannot be read ({error.strerror or 'damaged'})") from error
    except (zipfile.BadZipFile, zlib.error, EOFError, KeyError, TypeError, ValueError, NotImplementedError) as error:
        reason = " ".join(str(error).split())[:100]
        raise WorkspaceError(f"{path.name}: not a LutForge workspace, or damaged ({reason})") from error


def _document(archive: zipfile.ZipFile) -> dict[str, Any]:
    if DOCUMENT not in archive.namelist() or archive.getinfo(DOCUMENT).file_size > 1 << 20:
        raise WorkspaceError("not a LutForge workspace")
    document = json.loads(archive.read(DOCUMENT))
    if not isinstance(document, dict) or document.get("format") != "lutforge-workspace":
        raise WorkspaceError("not a LutForge workspace")
    if document.get("version") != 1:
        raise WorkspaceError(f"workspace version {document.get('version')}; this LutForge reads version 1")
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
