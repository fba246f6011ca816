"""The state of one calibration at work, as values: samples, outliers and models."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.exposure_pairs import ExposurePairs
from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.response import Response
from lutforge.pipeline.evaluation import predict
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.filter_columns import FILTER_COLUMNS, column_values
from lutforge.studio.models import BASE_MODEL, LATTICE_MODEL, NO_MODEL, FitTask, FittedModel, ModelKind
from lutforge.thesis.options import Options

HandMark = Literal[1, -1, 0]
"""A mark that is set by hand."""
OUTLIER_BY_HAND: Final = 1
KEPT_BY_HAND: Final = -1
"""The sample takes part whatever the limits say."""
UNMARKED: Final = 0
MOST_GROUPS = 100


class WorkspaceError(LutForgeError):
    """A step that the workspace cannot take, or a workspace file that cannot be read."""


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
    builds_on_stages: whether a lattice takes response and matrix from the BASE_MODEL, where there is one.
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
            first, last = FILTER_COLUMNS[name].reach if name in FILTER_COLUMNS else (np.inf, -np.inf)
            if not first <= low <= high <= last:
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
        if self.fitted is None or self.model == LATTICE_MODEL:
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
        return column_values(self.samples, self.residual)

    @cached_property
    def filtered(self) -> dict[str, Mask]:
        """(n,) by column: the rows outside its limits."""
        return {
            name: FILTER_COLUMNS[name].outside(values, self.limits_of(name)) for name, values in self.columns.items()
        }

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
        if kind == BASE_MODEL:
            return ~self.outliers
        rows = self.excluded
        for name, limits in self.limits.items():
            counts = name != "residual" or self.model == LATTICE_MODEL
            if counts and limits != FILTER_COLUMNS[name].usual and not FILTER_COLUMNS[name].of_stages:
                rows = rows | self.filtered[name]
        return np.asarray(~rows | ((self.hand_marks == KEPT_BY_HAND) & ~self.excluded))

    def task(self, kind: ModelKind) -> FitTask:
        """The inputs that a fit of this kind takes now."""
        options = self.options.without_exposure_pairs(tuple(sorted(self.unticked_pairs)))
        stages = self.models.get(BASE_MODEL) if self.builds_on_stages and kind != BASE_MODEL else None
        return FitTask(kind, self.fitting_rows(kind), options, stages)

    def is_stale(self, kind: ModelKind) -> bool:
        """Whether a model was fitted to other samples, options or stages than would be taken now."""
        task = self.models[kind].task
        now = self.task(kind)
        if task is None:
            return False
        same = task.options == now.options and task.stages is now.stages and np.array_equal(task.rows, now.rows)
        return not same or (task.stages is not None and self.is_stale(BASE_MODEL))

    @property
    def fitted_rows(self) -> Mask:
        """(n,): the samples that the model in use was fitted to; before a fit, those that a lattice would take."""
        if self.fitted is None or self.fitted.task is None:
            return self.fitting_rows(self.model or LATTICE_MODEL)
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
        return self.limits.get(name, FILTER_COLUMNS[name].usual)

    def with_limits(self, limits: tuple[float, float], name: str) -> "Workspace":
        """Set the limits of a column; its usual ones are not held."""
        moved = {key: value for key, value in self.limits.items() if key != name}
        if limits != FILTER_COLUMNS[name].usual:
            moved[name] = limits
        return replace(self, limits=moved)

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


def with_profile(workspace: Workspace, profile: CameraProfile) -> Workspace:
    """Add a profile as the fitted model, under the name of the model that it holds."""
    has_lattice = any(style.render is not None for style in profile.styles.values())
    kind: ModelKind = LATTICE_MODEL if has_lattice else BASE_MODEL
    return workspace.with_model(kind, FittedModel(profile, predict(profile, workspace.samples)))
