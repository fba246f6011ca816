"""What one visitor has open: a workspace with its history, a look, what was written, and the work under way."""

import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from functools import wraps
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.arrays import Mask
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.charts import FittedChart
from lutforge.pipeline.response import FittedResponse
from lutforge.samples.extract import ShotSamples
from lutforge.studio.brackets import Bracket, BracketRequest
from lutforge.studio.elements import text
from lutforge.studio.fits import fit_model
from lutforge.studio.folders import Folders
from lutforge.studio.jobs import Job
from lutforge.studio.workspace import MODELS, FittedModel, History, Workspace, WorkspaceError
from lutforge.studio.workspace_file import Opened, open_paths, with_profile


@dataclass(frozen=True)
class Look:
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
    of: tuple[CameraProfile | None, Look]


def _held(document: Any, work: Callable[[], None]) -> None:
    document.hold("combine")
    try:
        work()
    finally:
        document.unhold()


@dataclass(eq=False)
class _Work:
    """A job under way: what gets its result, the callback that asks for it, and what it last said."""

    job: Job
    done: Callable[[Any], None]
    poll: Any = None
    said: str = ""


@dataclass(eq=False)
class Session:
    """Shared by the steps of one page, which are told of each change.

    accounts: of the shots that were sampled; left_out: why others were not; files: by shot its RAW file; look: of the
    Look step; look_chosen: whether the visitor chose it; written: by kind of export the last file; profile_source: the
    file that `loaded_profile` was opened from; bracket: pictures without RAW, open instead of samples, of which
    left_out names those that take no part; response: what was asked for and fitted to them.
    """

    folders: Folders
    history: History | None = None
    selected: Mask = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    loaded_profile: CameraProfile | None = None
    accounts: tuple[ShotSamples, ...] = ()
    left_out: tuple[str, ...] = ()
    files: Mapping[str, Path] = field(default_factory=dict)
    look: Look = field(default_factory=Look)
    look_chosen: bool = False
    profile_source: Path | None = None
    bracket: Bracket | None = None
    response: tuple[BracketRequest, FittedResponse | FittedChart] | None = None
    written: dict[str, Written] = field(default_factory=dict)
    on_change: Callable[[], None] = lambda: None
    on_look: Callable[[], None] = lambda: None
    on_select: Callable[[], None] = lambda: None

    def __post_init__(self) -> None:
        self._works: dict[str, _Work] = {}  # "long": fits, exports, samples; "short": pictures and their looks
        self.refreshing = False
        self.status = text(margin=(2, 12), height=22)
        self.progress = text(visible=False, sizing_mode="fixed", width=200, height=24, margin=(4, 8))
        self.cancel = self.button("Cancel", self._cancel, visible=False)

    # --- news ------------------------------------------------------------------------------------------------------

    def say(self, message: str, wrong: bool = False) -> None:
        """One line for the visitor, as text whatever it holds."""
        shown = escape(" ".join(message.split())[:400])
        style = ' style="color:var(--mui-palette-error-main);font-weight:600"' if wrong else ""
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

    def button(self, label: str, action: Callable[[], None], **options: Any) -> pmui.Button:
        """A button with what it does, guarded."""
        made = pmui.Button(label=label, size="small", **{"margin": (4, 4), "variant": "outlined", **options})
        made.on_click(self.guarded(lambda event: action()))
        return made

    @contextmanager
    def setting(self) -> Iterator[None]:
        """What a page sets meanwhile is no wish of the visitor: `watch` does not call back."""
        before, self.refreshing = self.refreshing, True
        try:
            yield
        finally:
            self.refreshing = before

    def watch(self, callback: Callable[[], None], *widgets: Any) -> None:
        """Call back, guarded, when widgets change, a slider while it moves; once for several changes at a time."""
        waiting: list[bool] = []

        def run() -> None:
            waiting.clear()
            callback()

        soon = self.guarded(run)

        def changed(event: Any) -> None:
            if not waiting and not self.refreshing:
                waiting.append(True)
                soon()

        for widget in widgets:
            widget.param.watch(changed, "value")

    def rested(self, callback: Callable[[], None]) -> Callable[[], None]:
        """The callback, guarded, once for many calls, a fifth of a second after the last of them."""
        run, waiting = self.guarded(callback), list[Any]()

        def later() -> None:
            document = pn.state.curdoc
            if document is None or document.session_context is None:
                run()
                return
            for one in waiting:
                with suppress(ValueError):  # it has been called
                    document.remove_timeout_callback(one)
            waiting[:] = [document.add_timeout_callback(run, 200)]

        return later

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
        if self.loaded_profile is None:
            raise WorkspaceError("no profile yet: compute a model under Model, or open a profile (.npz)")
        return self.loaded_profile

    @property
    def has_profile(self) -> bool:
        """Whether `profile` is there."""
        return self.loaded_profile is not None or (self.history is not None and bool(self.history.present.model))

    @property
    def profile_file(self) -> Path | None:
        """The file that `profile` was opened from; None where it was made in this visit."""
        return self.profile_source if self.has_profile and self.profile is self.loaded_profile else None

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
        if "long" in self._works:
            raise WorkspaceError(f"{self._works['long'].job.title} is still under way: cancel it, or wait")
        self._begin("long", title, done, function, *arguments)

    def start_short(
        self, title: str, done: Callable[[Any], None], function: Callable[..., Any], *arguments: Any
    ) -> None:
        """Work of seconds in another process, beside what takes long; it takes the place of the last such work."""
        if "short" in self._works:
            self._end("short").job.cancel()
        self._begin("short", title, done, function, *arguments)

    def _begin(self, kind: str, title: str, done: Callable[[Any], None], *call: Any) -> None:
        work = self._works[kind] = _Work(Job(title, *call), done)
        self.say(f"{title} …")
        self._share(0.0)
        self.progress.visible = self.cancel.visible = True
        if pn.state.curdoc is not None:
            work.poll = pn.state.add_periodic_callback(self.guarded(lambda: self.poll(kind)), period=120)

    def _end(self, kind: str) -> _Work:
        work = self._works.pop(kind)
        self.progress.visible = self.cancel.visible = bool(self._works)
        if work.poll is not None:
            work.poll.stop()
        return work

    def poll(self, kind: str) -> None:
        """Take over what the job of a kind has reported."""
        if kind not in self._works:
            return
        work = self._works[kind]
        report, title = work.job.report, work.job.title
        if report.state == "running":
            self._share(report.share)
            if report.message != work.said:  # other news stay until there are new ones
                work.said = report.message
                self.say(f"{title}: {report.message}")
            return
        self._end(kind)
        if report.state == "done":
            work.done(report.result)
        else:
            self.say(f"{title}: {report.message}", wrong=report.state == "failed")

    def _share(self, done: float) -> None:
        self.progress.object = f"<progress aria-label='done' value='{done:.2f}' style='width:100%'></progress>"

    @property
    def short_job(self) -> Job | None:
        """The short work under way."""
        return self._works["short"].job if "short" in self._works else None

    def _cancel(self) -> None:
        for kind in [kind for kind in ("long", "short") if kind in self._works][:1]:
            self._works[kind].job.cancel()
            self.poll(kind)

    def close(self) -> None:
        """The visitor has gone."""
        for work in self._works.values():
            work.job.cancel()

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
        self.bracket, self.response = opened.bracket, None
        self.look_chosen &= opened.bracket is None and opened.workspace is None
        if opened.bracket is not None:
            self.history = self.loaded_profile = None
            self.accounts, self.left_out, self.files = (), (), {}
            self.say(f"{names}: {opened.bracket}")
        if opened.profile is not None:
            self.loaded_profile, self.profile_source = opened.profile, opened.profile_source
        if opened.workspace is not None:
            if opened.profile is None:
                self.loaded_profile = None
            self.history, self.files = History(opened.workspace), opened.files
            self.accounts, self.left_out = opened.accounts, opened.left_out
            self.selected = np.zeros(len(opened.workspace.samples), dtype=np.bool_)
            shots = len(np.unique(opened.workspace.samples.shot))
            self.say(f"{names}: {len(opened.workspace.samples):,} samples of {shots} shots")
        elif opened.profile is not None:
            if self.history is not None and str(self.workspace.samples.camera[0]) == opened.profile.camera:
                self.history = self.history.do(with_profile(self.workspace, opened.profile))
            self.say(f"{names}: profile of {opened.profile.camera}")
        self.on_change()

    def take_response(self, request: BracketRequest, fitted: FittedResponse | FittedChart) -> None:
        """Take over what was fitted to a bracket."""
        self.response, self.loaded_profile, self.profile_source = (request, fitted), fitted.profile, None
        self.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
        self.on_change()
