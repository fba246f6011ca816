"""The session of a visitor: a workspace with its history, a look, files that were written, and work under way.

A session outlives the page that shows it: a page is attached to it, and detached when its tab is closed.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from lutforge.arrays import Mask
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.looks import ChosenLook, usual_setting
from lutforge.pipeline.photographs import Photograph
from lutforge.pipeline.response import FittedResponse
from lutforge.pipeline.response_request import ResponseRequest
from lutforge.studio.background import Background
from lutforge.studio.dropped_files import DroppedFiles
from lutforge.studio.folders import Folders
from lutforge.studio.history import Change, History
from lutforge.studio.models import NO_MODEL
from lutforge.studio.opening import Opened
from lutforge.studio.page_link import PageLink
from lutforge.studio.undoable_state import UndoableState
from lutforge.studio.workspace import Workspace, WorkspaceError


@dataclass(frozen=True, eq=False)
class Written:
    """A file that was written. kind: of export; lines: on its contents; command: the command line that writes it.

    profile, look: those that it was made from; look_fields: the names of the fields of the look that it depends on.
    """

    kind: str
    path: Path
    lines: tuple[str, ...]
    command: str
    profile: CameraProfile | None
    look: ChosenLook
    look_fields: tuple[str, ...] = ()


class Session:
    """The work of one visitor, which outlives the page that shows it.

    state: what can be undone; a change replaces it. selected: (n,) the samples that are selected in all plots.
    photograph: the one that Look shows; is_unseen: whether the look cannot be applied to it yet. look_view: what the
    view of Look shows, by its parameters' names. written: by kind of export the last file; own_files: all that were
    written, which may be replaced unasked. dropped: files that were dropped. step: the one that is seen.
    control_values: by step and place, of the controls that no other state holds. work: what runs in other processes.
    page: the link to the page that shows the session.
    """

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self.state = UndoableState()
        self.history: History[UndoableState] = History()
        self.selected: Mask = np.zeros(0, dtype=np.bool_)
        self.photograph: Photograph | None = None
        self.is_unseen = False
        self.look_view: dict[str, Any] = {}
        self.written: dict[str, Written] = {}
        self.own_files: set[Path] = set()
        self.dropped = DroppedFiles()
        self.step = "Shots"
        self.control_values: dict[tuple[str, int], Any] = {}
        self.work = Background()
        self.page = PageLink()
        self.attach()

    @property
    def workspace(self) -> Workspace | None:
        """The samples with their marks and models; None before any are open."""
        return self.state.workspace

    @property
    def opened(self) -> Opened:
        """The contents of the files that were opened."""
        return self.state.opened

    @property
    def response(self) -> tuple[ResponseRequest, FittedResponse] | None:
        """The response of a bracket, as it was asked for and fitted; None before."""
        return self.state.response

    def attach(self) -> None:
        """Begin to be shown by another page, with the last news."""
        self._link(PageLink())
        self.work.attach(self.page)

    def detach(self) -> None:
        """Let go of a page that is closed: long work goes on, and what waits for it; the next page has the results."""
        self._link(PageLink())
        self.work.detach(self.page)

    def _link(self, page: PageLink) -> None:
        page.status.take(self.page.status)
        self.page = page

    @property
    def is_empty(self) -> bool:
        """Whether nothing is open, and nothing is under way."""
        return self.workspace is None and self.profile is None and not self.work.queue.works

    def __str__(self) -> str:
        parts = []
        if self.workspace is not None:
            shots = len(np.unique(self.workspace.samples.shot))
            parts.append(f"{len(self.workspace.samples):,} samples of {shots} shots")
        if self.profile is not None:
            parts.append(f"profile of {self.profile.camera}")
        return ", ".join([*parts, *(f"{work.title} under way" for work in self.work.queue.works)])

    @property
    def profile(self) -> CameraProfile | None:
        """The profile of the model in use, or the one that was opened."""
        fitted = None if self.workspace is None else self.workspace.fitted
        return self.opened.profile if fitted is None else fitted.profile

    def require_workspace(self) -> Workspace:
        """The workspace. Raises WorkspaceError before samples are open."""
        if self.workspace is None:
            raise WorkspaceError("no samples are open: open a folder of shots or a sample table under Shots")
        return self.workspace

    def require_profile(self) -> CameraProfile:
        """The profile. Raises WorkspaceError where there is none."""
        if self.profile is None:
            raise WorkspaceError("no profile yet: compute a model under Model, or open a profile (.npz)")
        return self.profile

    @property
    def is_stale(self) -> bool:
        """Whether samples or options have changed since the model in use was fitted."""
        workspace = self.workspace
        return workspace is not None and workspace.model != NO_MODEL and workspace.is_stale(workspace.model)

    @property
    def look(self) -> ChosenLook:
        """The look that is shown, else the camera's usual one, where there is a profile."""
        return self.state.chosen or ChosenLook(target="" if self.profile is None else usual_setting(self.profile))

    def is_old(self, written: Written) -> bool:
        """Whether a file is of another profile or look than the present ones, or its model is stale."""
        has_other_look = any(getattr(written.look, name) != getattr(self.look, name) for name in written.look_fields)
        return self.is_stale or written.profile is not self.profile or has_other_look

    def start_over(self, workspace: Workspace | None) -> None:
        """Begin with this workspace, or with none, with nothing selected and nothing to undo."""
        self.state = replace(self.state, workspace=workspace)
        self.history = History()
        self.selected = np.zeros(0 if workspace is None else len(workspace.samples), dtype=np.bool_)

    def change_workspace(self, workspace: Workspace, news: str = "", step: str = "") -> None:
        """Make this the present workspace, show the news, if there are any, and draw the page anew."""
        self.commit_workspace(workspace, news or "change", step=step)
        if news:
            self.page.say(news)
        self.page.on_change()

    def commit_workspace(
        self, workspace: Workspace, name: str = "change", again: str = "", key: str = "", step: str = ""
    ) -> None:
        """Make this the present workspace, without drawing the page: the caller does, or its control shows it already.

        name, again, key, step: as in `record_change`.
        """
        before = self.state
        self.state = replace(before, workspace=workspace)
        self.record_change(before, name, again, key, step)

    def record_change(self, before: UndoableState, name: str, again: str = "", key: str = "", step: str = "") -> None:
        """Let the change from the state `before` to the present one be undone.

        name, again: the change as Undo and Redo offer it; key: of a control that is still moving; step: where the
        change was made, the present step if not given.
        """
        self.history.add(Change(step or self.step, before, self.state, name, again or name, key))

    def undo(self) -> None:
        """Take back the last change of the step that is seen, if there is one."""
        change = self.history.last(self.step)
        if change is not None:
            self.page.say(f"undone: {change.name}")
            self._restore(self.history.undo(self.step, self.state))

    def redo(self) -> None:
        """Make the change again that was undone last in the step that is seen, if there is one."""
        change = self.history.next(self.step)
        if change is not None:
            self.page.say(f"done again: {change.again}")
            self._restore(self.history.redo(self.step, self.state))

    def _restore(self, state: UndoableState) -> None:
        """Make this the present state; what is selected stays where there are as many samples."""
        count = 0 if state.workspace is None else len(state.workspace.samples)
        if len(self.selected) != count:
            self.selected = np.zeros(count, dtype=np.bool_)
        self.state = state
        self.page.on_change()

    def select(self, rows: Mask) -> None:
        """Select samples, in all plots."""
        self.selected = rows
        self.page.on_select()

    def close(self) -> None:
        """End all jobs, and remove the files that were dropped: the session cannot be continued."""
        self.work.queue.end(self.work.queue.works)
        self.detach()
        self.dropped.remove()
