"""What one visitor has open: a workspace with its history, a selection, the work under way, a line of news."""

import logging
from collections.abc import Callable, Mapping
from functools import wraps
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn

from lutforge.arrays import Mask
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.studio.elements import Slider, button, text
from lutforge.studio.folders import Folders
from lutforge.studio.jobs import Job
from lutforge.studio.workspace import History, Workspace, WorkspaceError
from lutforge.studio.workspace_file import Opened, open_paths, with_profile


def _held(document: Any, work: Callable[[], None]) -> None:
    document.hold("combine")
    try:
        work()
    finally:
        document.unhold()


class Session:
    """Shared by the views of one page; each view refreshes itself when it is told to."""

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self.history: History | None = None
        self.selected: Mask = np.zeros(0, dtype=np.bool_)
        self.loaded_profile: CameraProfile | None = None
        self.files: Mapping[str, Path] = {}
        self.job: Job | None = None
        self.on_change: Callable[[], None] = lambda: None
        self.on_select: Callable[[], None] = lambda: None
        self._done: Callable[[Any], None] = lambda result: None
        self._poll: Any = None
        self.status = text(sizing_mode="stretch_width", margin=(0, 8))
        self.progress = pn.indicators.Progress(value=0, max=100, width=160, visible=False, margin=(6, 4))
        self.cancel = self.button("Cancel", self._cancel, visible=False)
        self.say("Open a sample table, a folder of shots, a profile or a workspace.")

    # --- news ------------------------------------------------------------------------------------------------------

    def say(self, message: str, wrong: bool = False) -> None:
        """One line for the visitor, as text whatever it holds."""
        shown = escape(" ".join(message.split())[:400])
        style = ' style="color:#a11a0e;font-weight:600"' if wrong else ""
        self.status.object = f'<div role="{"alert" if wrong else "status"}"{style}>{shown}</div>'

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback with its errors as a line in the page, and all that it changes as one message to the page."""

        def run(*arguments: Any) -> None:
            try:
                callback(*arguments)
            except LutForgeError as error:
                self.say(str(error), wrong=True)
            except Exception as error:
                logging.getLogger("lutforge.studio").exception("in the page")
                self.say(f"this failed: {type(error).__name__}: {error}", wrong=True)

        @wraps(callback)
        def guarded(*arguments: Any) -> None:
            document = pn.state.curdoc
            if document is None or document.session_context is None:
                run(*arguments)
                return
            # Panel may call without the document's lock, under which alone Bokeh's models can be changed.
            document.add_next_tick_callback(lambda: _held(document, lambda: run(*arguments)))

        return guarded

    def button(self, name: str, action: Callable[[], None], **options: Any) -> pn.widgets.Button:
        """A button with what it does, guarded."""
        return button(name, on_click=self.guarded(lambda event: action()), **options)

    def watch(self, callback: Callable[[], None], *widgets: Any) -> None:
        """Call back, guarded, when a widget's value changes, or a slider has moved."""
        for widget in widgets:
            if isinstance(widget, Slider):
                widget.on_move(self.guarded, callback)
            else:
                widget.param.watch(self.guarded(lambda event: callback()), "value")

    # --- state -----------------------------------------------------------------------------------------------------

    @property
    def workspace(self) -> Workspace:
        """The present state. Raises WorkspaceError before samples are open."""
        if self.history is None:
            raise WorkspaceError("no samples are open: open a sample table or a folder of shots first")
        return self.history.present

    @property
    def profile(self) -> CameraProfile:
        """The profile of the model in use, or the one that was opened. Raises WorkspaceError: none."""
        if self.history is not None and self.history.present.fitted is not None:
            return self.history.present.fitted.profile
        if self.loaded_profile is None:
            raise WorkspaceError("no profile yet: compute a model, or open a profile (.npz)")
        return self.loaded_profile

    @property
    def has_profile(self) -> bool:
        """Whether `profile` is there."""
        return self.loaded_profile is not None or (self.history is not None and bool(self.history.present.model))

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

    # --- work ------------------------------------------------------------------------------------------------------

    def start(self, title: str, done: Callable[[Any], None], function: Callable[..., Any], *arguments: Any) -> None:
        """Work in another process; `done` gets its result. One at a time. Raises WorkspaceError while one runs."""
        if self.job is not None:
            raise WorkspaceError(f"{self.job.title} is still under way: cancel it, or wait")
        self.job, self._done = Job(title, function, *arguments), done
        self.say(f"{title} …")
        self.progress.value, self.progress.visible, self.cancel.visible = 0, True, True
        if pn.state.curdoc is not None:
            self._poll = pn.state.add_periodic_callback(self.guarded(self.poll), period=120)

    def poll(self) -> None:
        """Take over what the job has reported."""
        if self.job is None:
            return
        job, report = self.job, self.job.report
        if report.state == "running":
            self.progress.value = int(100 * report.share)
            self.say(f"{job.title}: {report.message}")
            return
        self.job = None
        self.progress.visible = self.cancel.visible = False
        if self._poll is not None:
            self._poll.stop()
            self._poll = None
        if report.state == "done":
            self._done(report.result)
        else:
            self.say(f"{job.title}: {report.message}", wrong=report.state == "failed")

    def _cancel(self) -> None:
        if self.job is not None:
            self.job.cancel()
            self.poll()

    def close(self) -> None:
        """The visitor has gone."""
        if self.job is not None:
            self.job.cancel()

    # --- opening ---------------------------------------------------------------------------------------------------

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.start(f"opening {names[:80]}", lambda opened: self._opened(opened, names), open_paths, paths)

    def _opened(self, opened: Opened, names: str) -> None:
        if opened.profile is not None:
            self.loaded_profile = opened.profile
        if opened.workspace is not None:
            if opened.profile is None:
                self.loaded_profile = None
            self.history, self.files = History(opened.workspace), opened.files
            self.selected = np.zeros(len(opened.workspace.samples), dtype=np.bool_)
            shots = len(np.unique(opened.workspace.samples.shot))
            self.say(f"{names}: {len(opened.workspace.samples):,} samples of {shots} shots")
        elif opened.profile is not None:
            if self.history is not None and str(self.workspace.samples.camera[0]) == opened.profile.camera:
                self.history = self.history.do(with_profile(self.workspace, opened.profile))
            self.say(f"{names}: profile of {opened.profile.camera}")
        self.on_change()
