"""What one visitor has open: a workspace with its history, a look, what was written, and the work under way."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from lutforge.arrays import Mask
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.charts import FittedChart
from lutforge.pipeline.response import FittedResponse
from lutforge.studio.brackets import BracketRequest
from lutforge.studio.fits import fit_model
from lutforge.studio.folders import Folders
from lutforge.studio.session_base import SessionBase
from lutforge.studio.workspace import MODELS, FittedModel, History, Workspace, WorkspaceError
from lutforge.studio.workspace_file import Opened, open_paths, with_profile


@dataclass(frozen=True)
class ChosenLook:
    """The look that was chosen. source, target: STYLE/WB, "" before; ev: exposure change in stops."""

    source: str = ""
    target: str = ""
    ev: float = 0.0


@dataclass(frozen=True, eq=False)
class Written:
    """A file that was written. told: a line each; command: what does the same; of: what it was made from."""

    what: str
    path: Path
    told: tuple[str, ...]
    command: str
    of: tuple[CameraProfile | None, ChosenLook]


@dataclass(eq=False)
class Session(SessionBase):
    """Shared by the steps of one page, which are told of each change.

    opened: where the samples, the bracket and a profile that is not of this visit come from; look: of the Look step;
    look_chosen: whether the visitor chose it; written: by kind of export the last file; pictures_out: the names of the
    pictures of a bracket that take no part; response: what was asked for and fitted to them.
    """

    folders: Folders
    history: History | None = None
    selected: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    opened: Opened = field(default_factory=Opened)
    look: ChosenLook = field(default_factory=ChosenLook)
    look_chosen: bool = False
    pictures_out: tuple[str, ...] = ()
    response: tuple[BracketRequest, FittedResponse | FittedChart] | None = None
    written: dict[str, Written] = field(default_factory=dict)
    on_change: Callable[[], None] = lambda: None
    on_look: Callable[[], None] = lambda: None
    on_select: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        super().__init__()

    # --- state -----------------------------------------------------------------------------------------------------

    @property
    def workspace(self) -> Workspace:
        """The present state. Raises WorkspaceError before samples are open."""
        if self.history is None:
            raise WorkspaceError("no samples are open: open a folder of shots or a sample table under Shots")
        return self.history.present

    @property
    def profile(self) -> CameraProfile:
        """The profile of the model in use, or the one that was opened. Raises WorkspaceError: none."""
        if self.history is not None and self.history.present.fitted is not None:
            return self.history.present.fitted.profile
        if self.opened.profile is None:
            raise WorkspaceError("no profile yet: compute a model under Model, or open a profile (.npz)")
        return self.opened.profile

    @property
    def has_profile(self) -> bool:
        """Whether `profile` is there."""
        return self.opened.profile is not None or (self.history is not None and bool(self.history.present.model))

    @property
    def profile_file(self) -> Path | None:
        """The file that `profile` was opened from; None where it was made in this visit."""
        return self.opened.profile_source if self.has_profile and self.profile is self.opened.profile else None

    @property
    def is_stale(self) -> bool:
        """Whether samples or options have changed since the model in use was fitted."""
        return self.history is not None and bool(self.workspace.model) and self.workspace.is_stale(self.workspace.model)

    @property
    def made(self) -> tuple[CameraProfile | None, ChosenLook]:
        """What is written is made from: the profile, None where there is none, and the look."""
        return self.profile if self.has_profile else None, self.look

    def is_old(self, written: Written) -> bool:
        """Whether a file is of another profile or look than the present ones, or its model is stale."""
        return self.is_stale or written.of[0] is not self.made[0] or written.of[1] != self.look

    def change(self, workspace: Workspace) -> None:
        """Make this the present state of the workspace."""
        assert self.history is not None
        self.history = self.history.do(workspace)
        self.on_change()

    def undo(self) -> None:
        """One state back."""
        if self.history is not None and self.history.past:
            self.history = self.history.undo()
            self.say("undone")
            self.on_change()

    def redo(self) -> None:
        """One state on."""
        if self.history is not None and self.history.future:
            self.history = self.history.redo()
            self.say("done again")
            self.on_change()

    def select(self, rows: Mask) -> None:
        """Select samples, in all plots."""
        self.selected = rows
        self.on_select()

    # --- fitting and opening ------------------------------------------------------------------------------------------

    def fit(self, *kinds: str) -> None:
        """Fit models one after the other, each on those before it."""
        kind, *others = kinds
        workspace = self.workspace
        task = workspace.task(kind)

        def done(fitted: FittedModel) -> None:
            now = self.workspace
            if now.samples is not workspace.samples:
                raise WorkspaceError("other samples were opened meanwhile: compute again")
            self.change(now.with_model(kind, replace(fitted, task=task)))
            self.say(f"{MODELS[kind]}: fitted to {int(task.rows.sum()):,} samples")
            if others:
                self.fit(*others)

        self.start(MODELS[kind], done, fit_model, task, workspace.samples)

    # --- opening ---------------------------------------------------------------------------------------------------

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.start(f"opening {names[:80]}", lambda opened: self._opened(opened, names), open_paths, paths)

    def _opened(self, opened: Opened, names: str) -> None:
        self.pictures_out, self.response = (), None
        self.look_chosen &= opened.bracket is None and opened.workspace is None
        if opened.bracket is not None:
            self.history = None
            self.say(f"{names}: {opened.bracket}")
        elif opened.workspace is not None:
            self.history = History(opened.workspace)
            self.selected = np.zeros(len(opened.workspace.samples), dtype=np.bool_)
            shots = len(np.unique(opened.workspace.samples.shot))
            self.say(f"{names}: {len(opened.workspace.samples):,} samples of {shots} shots")
        elif opened.profile is not None:  # beside the samples that are open
            if self.history is not None and str(self.workspace.samples.camera[0]) == opened.profile.camera:
                self.history = self.history.do(with_profile(self.workspace, opened.profile))
            self.say(f"{names}: profile of {opened.profile.camera}")
            opened = replace(self.opened, profile=opened.profile, profile_source=opened.profile_source, bracket=None)
        self.opened = opened
        self.on_change()

    def take_response(self, request: BracketRequest, fitted: FittedResponse | FittedChart) -> None:
        """Take over what was fitted to a bracket."""
        self.response = request, fitted
        self.opened = replace(self.opened, profile=fitted.profile, profile_source=None)
        self.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
        self.on_change()
