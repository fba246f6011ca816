"""The state of one calibration at work, as values: samples, outliers and models; and the file of it.

The file is a zip of JSON, a sample table, marks and profiles; read with limits, not unpickled.
"""

import json
import shutil
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.atomic_write import atomic_path, scratch_folder
from lutforge.boundary import reading
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.pairs_of_samples import pairs_of_samples
from lutforge.colour.saturation import saturation
from lutforge.errors import CalibrationError, LutForgeError
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.response import Response
from lutforge.pipeline.calibration import calibrate, calibrate_base
from lutforge.pipeline.evaluation import Predicted, predict
from lutforge.progress import Progress
from lutforge.samples.sample_set import SampleSet, with_setting_names
from lutforge.samples.table import read_samples
from lutforge.thesis.options import Options, ThesisOptions, stated_options

ModelKind = Literal["matrix", "lattice"]
"""The kinds of models that are fitted, each kept as a camera profile."""
MATRIX: Final = "matrix"
"""Response, matrix and white balances: the stages before the gamut map."""
LATTICE: Final = "lattice"
"""The whole camera model with its gamut map, baked to lattices."""
NO_MODEL: Final = ""
"""The model in use before the first fit."""
MODEL_TITLES: dict[ModelKind, str] = {MATRIX: "Response, matrix and white balance", LATTICE: "Lattice"}
"""In the order of the calibration."""
HandMark = Literal[1, -1, 0]
"""A mark that is set by hand."""
OUTLIER_BY_HAND: Final = 1
KEPT_BY_HAND: Final = -1
"""The sample takes part whatever the limits say."""
UNMARKED: Final = 0
MOST_GROUPS = 100
SUFFIX = ".workspace"
DOCUMENT = "workspace.json"
SAMPLES = "samples.npz"
MARKS = "marks.npy"


class WorkspaceError(LutForgeError):
    """A step that the workspace cannot take, or a workspace file that cannot be read."""


@dataclass(frozen=True)
class Column:
    """A column of the table that samples are filtered by. usual: the limits that nobody moved, both within `reach`.

    of_stages: whether its limits leave samples out of the stages alone, since gamut map and lattice need them.
    """

    title: str
    reach: tuple[float, float]
    usual: tuple[float, float]
    step: float
    of_stages: bool = False


COLUMNS = {
    "saturation": Column("Saturation", (0.0, 1.0), (0.0, 1.0), 0.01, of_stages=True),
    "darkest": Column("Smallest JPEG code", (0, 255), (1, 255), 1),
    "brightest": Column("Largest JPEG code", (0, 255), (0, 254), 1),
    "raw": Column("Largest RAW value", (0.0, 1.0), (0.0, 0.98), 0.01),
    "residual": Column("Distance from the model, codes", (0.0, 64.0), (0.0, 64.0), 0.5),
}
"""By their names; a limit at the end of the reach leaves nothing out."""


@dataclass(frozen=True, eq=False)
class FitTask:
    """The inputs of a fit: samples (n,), options, and the stages, fitted before, that it stands on.

    stages: a model of the kind MATRIX, whose response, matrix and white balances are taken; None fits them anew.
    """

    kind: ModelKind
    rows: Mask
    options: Options
    stages: "FittedModel | None" = None


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A profile, and what it predicts of every sample.

    task: what it was fitted to; None where it comes from a file.
    """

    profile: CameraProfile
    predicted: Predicted
    task: FitTask | None = None


@dataclass(frozen=True, eq=False)
class Workspace:
    """Samples, what the visitor has marked and chosen of them, and the models that were fitted to them.

    samples: as loaded; their RAW is NaN where the camera has none.
    pairs: of exposures; None where the samples have none.
    limits: (low, high) by the name of a column; what lies outside is an outlier of the stages.
    hand_marks: (n,) each a `HandMark`.
    groups: masks (n,) of outliers, by name; they take part in no fit.
    inactive_groups: the names of the groups that have no effect.
    models: by kind, as fitted.
    model: the kind that plots and residuals use, NO_MODEL before the first fit.
    left_out_shots: the names of the shots that take part in no fit.
    unticked_pairs: the exposure pairs from which no response is fitted, by the names of their shots.
    builds_on_stages: whether a lattice takes response and matrix from the model of the kind MATRIX, where there is one.
    """

    samples: SampleSet
    pairs: ExposurePairs | None = None
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    hand_marks: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    groups: Mapping[str, Mask] = field(default_factory=dict)
    inactive_groups: frozenset[str] = frozenset()
    models: Mapping[ModelKind, FittedModel] = field(default_factory=dict)
    model: ModelKind | Literal[""] = NO_MODEL
    options: Options = field(default_factory=CalibrationOptions)
    left_out_shots: frozenset[str] = frozenset()
    unticked_pairs: frozenset[tuple[str, str]] = frozenset()
    builds_on_stages: bool = True

    def __post_init__(self) -> None:
        count = len(self.samples)
        if len(self.hand_marks) == 0:
            object.__setattr__(self, "hand_marks", np.zeros(count, dtype=np.int8))
        if self.hand_marks.shape != (count,) or any(rows.shape != (count,) for rows in self.groups.values()):
            raise WorkspaceError(f"workspace: its marks are not of its {count} samples")
        if self.model and self.model not in self.models:
            raise WorkspaceError(f'workspace: it holds no model "{self.model}"')
        for name, (low, high) in self.limits.items():
            if name not in COLUMNS or not COLUMNS[name].reach[0] <= low <= high <= COLUMNS[name].reach[1]:
                raise WorkspaceError(f"workspace: limits {low} to {high} of {name} mean nothing")

    @property
    def has_raw(self) -> bool:
        """Whether the samples are of a camera with RAW, its own or another's."""
        return bool(np.isfinite(self.samples.raw).any())

    @property
    def fitted(self) -> FittedModel | None:
        """The model in use."""
        return self.models[self.model] if self.model else None

    @property
    def response(self) -> Response | None:
        """f of the first style that has one; None before the first fit, and of a lattice."""
        if self.fitted is None or self.model == LATTICE:
            return None
        styles = self.fitted.profile.styles.values()
        return next((style.models[0].response for style in styles if style.models), None)

    @property
    def response_pairs(self) -> ExposurePairs | None:
        """The exposure pairs from which a response is fitted; None where the samples have none."""
        return None if self.pairs is None else self.pairs.without(self.unticked_pairs)

    @cached_property
    def residual(self) -> Array:
        """(n,) RGB distance between the JPEG and what the model in use renders; 0 before the first fit."""
        if self.fitted is None:
            return np.zeros(len(self.samples))
        return np.asarray(np.linalg.norm(self.fitted.predicted.rendered - self.samples.srgb, axis=1))

    @cached_property
    def columns(self) -> dict[str, Array]:
        """(n,) by name: the columns of the table that samples are filtered by."""
        codes = 255 * self.samples.srgb
        raw = self.samples.raw.max(axis=1)
        known = (saturation(self.samples.srgb), codes.min(axis=1), codes.max(axis=1), raw, 255 * self.residual)
        return dict(zip(COLUMNS, known, strict=True))

    @cached_property
    def filtered(self) -> dict[str, Mask]:
        """(n,) by column: the rows outside its limits, to a millionth; what is unknown is inside."""
        rows = {}
        for name, values in self.columns.items():
            low, high = self.limits_of(name)
            first, last = COLUMNS[name].reach
            rows[name] = ((values < low - 1e-6) & (low > first)) | ((values > high + 1e-6) & (high < last))
        return rows

    @cached_property
    def excluded(self) -> Mask:
        """(n,): rows that take part in no fit: marked by hand, in an active group, or of a shot that is out."""
        rows = np.logical_or.reduce(
            [self.hand_marks == OUTLIER_BY_HAND, *(self.groups[name] for name in self.active_groups)]
        )
        return np.asarray(
            (rows & (self.hand_marks != KEPT_BY_HAND)) | np.isin(self.samples.shot, list(self.left_out_shots))
        )

    @cached_property
    def outliers(self) -> Mask:
        """(n,): rows that take no part in the fits of response, matrix and white balance.

        They are excluded, outside the limits, or in none of the exposure pairs that are ticked, where some are not.
        """
        rows = np.logical_or.reduce(list(self.filtered.values()))
        ticked = self.response_pairs
        if ticked is not None and self.unticked_pairs:
            rows |= ~np.isin(np.arange(len(rows)), [ticked.first_row, ticked.second_row])
        return np.asarray((rows & (self.hand_marks != KEPT_BY_HAND)) | self.excluded)

    def fitting_rows(self, kind: ModelKind) -> Mask:
        """(n,): the samples that a fit of this kind of model takes.

        The gamut map and the lattice need the saturated colours that are kept from the response (thesis A.3.3), and
        find for themselves what is clipped: for them a limit counts where it was moved, that of the saturation never,
        and that of the residual where it is of such a model.
        """
        if kind == MATRIX:
            return ~self.outliers
        rows = self.excluded
        for name, limits in self.limits.items():
            counts = name != "residual" or self.model == LATTICE
            if counts and limits != COLUMNS[name].usual and not COLUMNS[name].of_stages:
                rows = rows | self.filtered[name]
        return np.asarray(~rows | ((self.hand_marks == KEPT_BY_HAND) & ~self.excluded))

    def task(self, kind: ModelKind) -> FitTask:
        """The inputs that a fit of this kind takes now."""
        options = self.options
        if isinstance(options, ThesisOptions):
            options = replace(options, without_pairs=tuple(sorted(self.unticked_pairs)))
        stages = self.models.get(MATRIX) if self.builds_on_stages and kind != MATRIX else None
        return FitTask(kind, self.fitting_rows(kind), options, stages)

    def is_stale(self, kind: ModelKind) -> bool:
        """Whether a model was fitted to other samples, options or stages than would be taken now."""
        task = self.models[kind].task
        now = self.task(kind)
        if task is None:
            return False
        same = task.options == now.options and task.stages is now.stages and np.array_equal(task.rows, now.rows)
        return not same or (task.stages is not None and self.is_stale(MATRIX))

    @property
    def fitted_rows(self) -> Mask:
        """(n,): the samples that the model in use was fitted to; before a fit, those that a lattice would take."""
        if self.fitted is None or self.fitted.task is None:
            return self.fitting_rows(self.model or LATTICE)
        return self.fitted.task.rows

    def mark(self, rows: Mask, mark: HandMark) -> "Workspace":
        """Mark rows by hand."""
        return replace(self, hand_marks=np.where(rows, np.int8(mark), self.hand_marks))

    def with_group(self, name: str, rows: Mask) -> "Workspace":
        """Add these rows as a named, active outlier group. Raises WorkspaceError: no name, no rows."""
        name = " ".join(name.split())[:60]
        if not name:
            raise WorkspaceError("an outlier group needs a name")
        if not rows.any():
            raise WorkspaceError(f"{name}: no samples to put into the group; select some first")
        if len(self.groups) >= MOST_GROUPS and name not in self.groups:
            raise WorkspaceError(f"{MOST_GROUPS} outlier groups are enough; delete one first")
        return replace(self, groups={**self.groups, name: rows.copy()}, inactive_groups=self.inactive_groups - {name})

    @property
    def active_groups(self) -> list[str]:
        """The names of the outlier groups in effect."""
        return [name for name in self.groups if name not in self.inactive_groups]

    def limits_of(self, name: str) -> tuple[float, float]:
        """The limits of a column."""
        return self.limits.get(name, COLUMNS[name].usual)

    def with_limits(self, limits: tuple[float, float], name: str) -> "Workspace":
        """Set the limits of a column; its usual ones are not held."""
        other_limits = {key: value for key, value in self.limits.items() if key != name}
        return replace(self, limits=other_limits if limits == COLUMNS[name].usual else {**other_limits, name: limits})

    def with_active_groups(self, names: list[str]) -> "Workspace":
        """Make just these groups active."""
        return replace(self, inactive_groups=frozenset(self.groups).difference(names))

    def without_group(self, name: str) -> "Workspace":
        """Remove the group of this name. Raises WorkspaceError where there is none."""
        if name not in self.groups:
            raise WorkspaceError(f"{name or 'no name'}: there is no such outlier group")
        return replace(self, groups={key: group for key, group in self.groups.items() if key != name})

    def with_model(self, kind: ModelKind, fitted: FittedModel) -> "Workspace":
        """Add a fitted model, in use from now on."""
        return replace(self, models={**self.models, kind: fitted}, model=kind)


def fit_model(task: FitTask, samples: SampleSet, progress: Progress) -> FittedModel:
    """Fit a model to some samples, and let it predict all. Raises CalibrationError where they do not determine it."""
    if task.rows.sum() < 10:
        raise CalibrationError(f"{int(task.rows.sum())} samples are left to fit; at least 10 are needed: filter less")
    chosen = samples.select(task.rows)
    if task.kind == MATRIX:
        profile = calibrate_base(chosen, task.options, progress)
    else:
        stages = None if task.stages is None else task.stages.profile
        profile = calibrate(chosen, task.options, progress, given=stages)
    progress("predicting all samples", 0.9)
    return FittedModel(profile, predict(profile, samples))


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
        with zipfile.ZipFile(path) as archive, scratch_folder() as folder:
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
    document = json.loads(archive.read(DOCUMENT)) if is_small else None
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
        stages = models.get(MATRIX) if builds_on_stages and kind != MATRIX else None
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


def with_profile(workspace: Workspace, profile: CameraProfile) -> Workspace:
    """Add a profile as the fitted model, under the name of the model that it holds."""
    has_lattice = any(style.render is not None for style in profile.styles.values())
    kind: ModelKind = LATTICE if has_lattice else MATRIX
    return workspace.with_model(kind, FittedModel(profile, predict(profile, workspace.samples)))


def find_pairs(samples: SampleSet) -> ExposurePairs | None:
    """The exposure pairs, None where there are none."""
    with suppress(CalibrationError):
        return pairs_of_samples(with_setting_names(samples))
    return None
