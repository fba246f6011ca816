"""The state of one calibration at work, as values: samples, what counts as an outlier, fitted models; undo and redo."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from lutforge.arrays import Array, Mask
from lutforge.calibration.options import CalibrationOptions
from lutforge.calibration.physical.exposure_pairs import ExposurePairs
from lutforge.calibration.physical.unsaturated import saturation
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile, ModelName
from lutforge.model.directions import Direction
from lutforge.model.response import Response
from lutforge.samples.sample_set import SampleSet

MODELS = {"matrix": "Response, matrix and white balance", "rbf": "Gamut map", "lattice": "Lattice"}
"""In the order of the calibration; each is kept as a camera profile."""
MOST_GROUPS = 100


class WorkspaceError(LutForgeError):
    """A step that the workspace cannot take, or a workspace file that cannot be read."""


@dataclass(frozen=True)
class Filters:
    """What counts as an outlier of the response.

    saturation: colours above it (1: none); darkest, brightest: JPEG values in any channel beyond these; raw_saturated:
    RAW values from it on; residual: RGB distance between the JPEG and what the model renders (None: any).
    """

    saturation: float = 1.0
    darkest: float = 1 / 255
    brightest: float = 254 / 255
    raw_saturated: float = 0.98
    residual: float | None = None

    def __post_init__(self) -> None:
        if not 0 <= self.darkest < self.brightest <= 1:
            raise WorkspaceError("the clipping limits must rise from dark to bright, between 0 and 1")
        if not 0 < self.saturation <= 1 or not 0 < self.raw_saturated <= 1:
            raise WorkspaceError("saturation limits lie above 0, up to 1")
        if self.residual is not None and not self.residual > 0:
            raise WorkspaceError("the residual distance is positive")


@dataclass(frozen=True, eq=False)
class Group:
    """A named outlier group. active: its samples take part in no fit."""

    rows: Mask
    active: bool = True


@dataclass(frozen=True, eq=False)
class FitTask:
    """What a fit takes: samples (n,), options, and the stages, fitted before, that it stands on.

    stages: a model of the kind "matrix", whose response, matrix and white balances are taken; None fits them anew.
    """

    kind: str
    rows: Mask
    options: CalibrationOptions
    stages: "FittedModel | None" = None

    def same(self, other: "FitTask") -> bool:
        """Whether both give the same model."""
        alike = self.kind == other.kind and self.options == other.options and self.stages is other.stages
        return alike and np.array_equal(self.rows, other.rows)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model, and what it makes of every sample, all (n, 3).

    scene: Ts Tw E; transformed: what stands before the response f, h(Ts Tw E) (a lattice has no f: its JPEG value);
    predicted: the JPEG value; linearized: the JPEG value backward, to be compared with `scene`. uniform_error: by style
    and direction, per axis the histogram of the squared error of a uniform lattice, where one was fitted. task: what it
    was fitted to; None where it comes from a file.
    """

    profile: CameraProfile
    scene: Array
    transformed: Array
    predicted: Array
    linearized: Array
    uniform_error: Mapping[tuple[str, Direction], tuple[Array, Array, Array]] = field(default_factory=dict)
    task: FitTask | None = None


@dataclass(frozen=True, eq=False)
class Workspace:
    """One state. samples: as loaded; pairs: their exposure pairs, None where there are none.

    hand: (n,) 1 for rows marked as outliers by hand, −1 for rows kept by hand whatever the filters say, else 0.
    model: the name of the fitted model that plots and residuals use, "" before the first fit. out: the shots that take
    no part; unticked: the exposure pairs that do not tell the response, by the names of their shots; own_stages:
    whether gamut map and lattice stand on the response and matrix that were fitted before.
    """

    samples: SampleSet
    pairs: ExposurePairs | None = None
    filters: Filters = field(default_factory=Filters)
    hand: NDArray[np.int8] = field(default_factory=lambda: np.zeros(0, dtype=np.int8))
    groups: Mapping[str, Group] = field(default_factory=dict)
    models: Mapping[str, FittedModel] = field(default_factory=dict)
    model: str = ""
    options: CalibrationOptions = field(default_factory=CalibrationOptions)
    out: frozenset[str] = frozenset()
    unticked: frozenset[tuple[str, str]] = frozenset()
    own_stages: bool = True

    def __post_init__(self) -> None:
        if len(self.hand) == 0:
            object.__setattr__(self, "hand", np.zeros(len(self.samples), dtype=np.int8))
        count = len(self.samples)
        if self.hand.shape != (count,) or any(group.rows.shape != (count,) for group in self.groups.values()):
            raise WorkspaceError(f"workspace: its marks are not of its {count} samples")
        if self.model and self.model not in self.models:
            raise WorkspaceError(f'workspace: it holds no model "{self.model}"')

    @cached_property
    def chroma(self) -> Array:
        """(n,) saturation of the JPEG colours, as the response fit counts it."""
        return saturation(self.samples.srgb)

    @property
    def fitted(self) -> FittedModel | None:
        """The model in use."""
        return self.models[self.model] if self.model else None

    @property
    def response(self) -> Response | None:
        """f of the first style that has one; None before the first fit, and of a lattice."""
        if self.fitted is None or self.model == "lattice":
            return None
        styles = self.fitted.profile.styles.values()
        return next((style.physical[0].response for style in styles if style.physical), None)

    @cached_property
    def residual(self) -> Array:
        """(n,) RGB distance between the JPEG and what the model in use renders; 0 before the first fit."""
        if self.fitted is None:
            return np.zeros(len(self.samples))
        return np.asarray(np.linalg.norm(self.fitted.predicted - self.samples.srgb, axis=1))

    @cached_property
    def filtered(self) -> dict[str, Mask]:
        """(n,) by filter: the rows that it finds."""
        limits, srgb, raw = self.filters, self.samples.srgb, self.samples.raw
        clipped = np.any((srgb < limits.darkest) | (srgb > limits.brightest), axis=1)
        far = np.zeros(len(srgb), dtype=np.bool_) if limits.residual is None else self.residual > limits.residual
        return {
            "saturation": self.chroma > limits.saturation,
            "clipping": clipped | np.any(raw >= limits.raw_saturated, axis=1),
            "residual": far,
        }

    @cached_property
    def removed(self) -> Mask:
        """(n,): rows that take part in no fit: marked by hand, in an active group, or of a shot that is out."""
        rows = self.hand > 0
        for group in self.groups.values():
            rows = rows | (group.rows & group.active)
        return np.asarray((rows & (self.hand >= 0)) | np.isin(self.samples.shot, list(self.out)))

    @cached_property
    def outliers(self) -> Mask:
        """(n,): rows that take no part in the fits of response, matrix and white balance.

        They are removed, found by a filter, or in none of the exposure pairs that are ticked, where some are not.
        """
        rows = np.logical_or.reduce([*self.filtered.values(), self.in_no_pair]) & (self.hand >= 0)
        return np.asarray(rows | self.removed)

    @cached_property
    def in_no_pair(self) -> Mask:
        """(n,): rows in none of the ticked exposure pairs; none where all are ticked."""
        rows = np.zeros(len(self.samples), dtype=np.bool_)
        if self.pairs is not None and self.unticked:
            ticked = self.pairs.without(self.unticked)
            rows[:] = True
            rows[ticked.first_row] = rows[ticked.second_row] = False
        return rows

    def fitting_rows(self, model: str) -> Mask:
        """(n,): the samples that a fit of this model takes.

        The gamut map and the lattice need the saturated colours that are kept from the response (thesis A.3.3), and
        find for themselves what is clipped: for them the saturation limit does not count, a clipping limit where it was
        moved, and the residual where it is that of such a model.
        """
        if model == "matrix":
            return ~self.outliers
        rows, limits, usual = self.removed, self.filters, Filters()
        if replace(limits, saturation=usual.saturation, residual=None) != usual:
            rows = rows | self.filtered["clipping"]
        if self.model in ("rbf", "lattice"):
            rows = rows | self.filtered["residual"]
        return np.asarray(~rows | ((self.hand < 0) & ~self.removed))

    def task(self, kind: str) -> FitTask:
        """What a fit of this kind would take now."""
        physical = replace(self.options.physical, without_pairs=tuple(sorted(self.unticked)))
        model: ModelName = "lattice" if kind == "lattice" else "rbf"
        stages = self.models.get("matrix") if self.own_stages and kind != "matrix" else None
        return FitTask(kind, self.fitting_rows(kind), replace(self.options, model=model, physical=physical), stages)

    def is_stale(self, kind: str) -> bool:
        """Whether a model was fitted to other samples, options or stages than would be taken now."""
        task = self.models[kind].task
        if task is None:
            return False
        return not task.same(self.task(kind)) or (task.stages is not None and self.is_stale("matrix"))

    @property
    def fitted_rows(self) -> Mask:
        """(n,): the samples that the model in use was fitted to; before a fit, those that a lattice would take."""
        if self.fitted is None or self.fitted.task is None:
            return self.fitting_rows(self.model or "lattice")
        return self.fitted.task.rows

    def mark(self, rows: Mask, outlier: bool) -> "Workspace":
        """Return the workspace with these rows marked by hand as outliers, or kept by hand."""
        return replace(self, hand=np.where(rows, np.int8(1 if outlier else -1), self.hand))

    def unmark(self, rows: Mask) -> "Workspace":
        """Return the workspace without marks by hand on these rows."""
        return replace(self, hand=np.where(rows, np.int8(0), self.hand))

    def with_group(self, name: str, rows: Mask) -> "Workspace":
        """Add these rows as a named, active outlier group. Raises WorkspaceError: no name, no rows."""
        name = " ".join(name.split())[:60]
        if not name:
            raise WorkspaceError("an outlier group needs a name")
        if not rows.any():
            raise WorkspaceError(f"{name}: no samples to put into the group; select some first")
        if len(self.groups) >= MOST_GROUPS and name not in self.groups:
            raise WorkspaceError(f"{MOST_GROUPS} outlier groups are enough; delete one first")
        return replace(self, groups={**self.groups, name: Group(rows.copy())})

    def with_active_groups(self, names: list[str]) -> "Workspace":
        """Make just these groups active."""
        groups = {name: replace(group, active=name in names) for name, group in self.groups.items()}
        return replace(self, groups=groups)

    def without_group(self, name: str) -> "Workspace":
        """Remove the group of this name. Raises WorkspaceError where there is none."""
        if name not in self.groups:
            raise WorkspaceError(f"{name or 'no name'}: there is no such outlier group")
        return replace(self, groups={key: group for key, group in self.groups.items() if key != name})

    def with_model(self, name: str, fitted: FittedModel) -> "Workspace":
        """Add a fitted model, in use from now on."""
        return replace(self, models={**self.models, name: fitted}, model=name)


@dataclass(frozen=True, eq=False)
class History:
    """Workspaces in the order that they were made; arrays that do not change are shared between them."""

    present: Workspace
    past: tuple[Workspace, ...] = ()
    future: tuple[Workspace, ...] = ()

    def do(self, workspace: Workspace) -> "History":
        """The next state; what was undone is gone."""
        return History(workspace, (*self.past, self.present)[-200:])

    def undo(self) -> "History":
        """One state back, if there is one."""
        if not self.past:
            return self
        return History(self.past[-1], self.past[:-1], (self.present, *self.future))

    def redo(self) -> "History":
        """One state on, if there is one."""
        if not self.future:
            return self
        return History(self.future[0], (*self.past, self.present), self.future[1:])
