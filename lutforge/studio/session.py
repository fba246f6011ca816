"""What one visitor has open: a workspace with its history, a look, what was written, and the work under way."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import wraps
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui
from bokeh.document import Document

from lutforge.arrays import Mask
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import NAMED_KELVIN
from lutforge.pipeline.evaluation import predict
from lutforge.pipeline.response import FittedResponse, ResponseRequest
from lutforge.progress import silent
from lutforge.studio import ui
from lutforge.studio.jobs import Job
from lutforge.studio.opening import Folders, Opened, open_paths
from lutforge.studio.workspace import MODELS, FittedModel, Workspace, WorkspaceError, fit_model, with_profile


@dataclass(frozen=True)
class ChosenLook:
    """A look. source, target: STYLE/WB, "" where not chosen; ev: exposure change in stops."""

    source: str = ""
    target: str = ""
    ev: float = 0.0


@dataclass(frozen=True, eq=False)
class Written:
    """A file that was written. lines: what there is to tell; command: what does the same; of: what it was made from."""

    what: str
    path: Path
    lines: tuple[str, ...]
    command: str
    of: tuple[CameraProfile | None, ChosenLook]


@dataclass(eq=False)
class _Work:
    """Work for a job, None while it waits. short: it runs beside what is long; message: what was told of it last."""

    title: str
    done: Callable[[Any], None]
    call: tuple[Any, ...]
    short: bool
    job: Job | None = None
    message: str = "starting"


class Session:
    """Shared by the steps of one page, which are told of each change.

    opened: where the samples, the bracket and a profile that is not of this visit come from; chosen: the look that is
    shown, None before; look_chosen: whether the visitor chose it; written: by kind of export the last file;
    pictures_out: the names of the pictures of a bracket that take no part; response: what was asked for and fitted to
    them.
    """

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self.past: tuple[Workspace, ...] = ()  # up to the present one
        self.future: tuple[Workspace, ...] = ()
        self.selected: Mask = np.zeros(0, dtype=np.bool_)
        self.opened = Opened()
        self.chosen: ChosenLook | None = None
        self.look_chosen = False
        self.pictures_out: tuple[str, ...] = ()
        self.response: tuple[ResponseRequest, FittedResponse] | None = None
        self.written: dict[str, Written] = {}
        self.on_change: Callable[[], None] = lambda: None
        self.on_look: Callable[[], None] = lambda: None
        self.on_select: Callable[[], None] = lambda: None
        self.refreshing = False
        self._wrong = False
        self._works: list[_Work] = []  # the first that is long is under way, and the one that is short
        self._polling: Any = None
        self.status = ui.text(margin=(2, 12), height=22)
        self.progress = ui.text(visible=False, sizing_mode="fixed", width=200, height=24, margin=(4, 8))
        self.cancel = self.button("Cancel", self._cancel, visible=False)

    @property
    def workspace(self) -> Workspace | None:
        """The present state; None before samples are open."""
        return self.past[-1] if self.past else None

    @property
    def profile(self) -> CameraProfile | None:
        """The profile of the model in use, or the one that was opened."""
        fitted = None if self.workspace is None else self.workspace.fitted
        return self.opened.profile if fitted is None else fitted.profile

    def require_workspace(self) -> Workspace:
        """The present state. Raises WorkspaceError before samples are open."""
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
        return workspace is not None and bool(workspace.model) and workspace.is_stale(workspace.model)

    @property
    def look(self) -> ChosenLook:
        """The look that is shown, else the camera's usual one, where there is a profile."""
        return self.chosen or ChosenLook(target="" if self.profile is None else usual_setting(self.profile))

    def is_old(self, written: Written) -> bool:
        """Whether a file is of another profile or look than the present ones, or its model is stale."""
        return self.is_stale or written.of[0] is not self.profile or written.of[1] != self.look

    def begin(self, workspace: Workspace | None) -> None:
        """Make this the first state of the workspace."""
        self.past, self.future = () if workspace is None else (workspace,), ()
        self.selected = np.zeros(0 if workspace is None else len(workspace.samples), dtype=np.bool_)

    def change(self, workspace: Workspace, news: str = "") -> None:
        """Make this the present state of the workspace, and tell the news, if there are any."""
        self.put(workspace)
        if news:
            self.say(news)
        self.on_change()

    def put(self, workspace: Workspace) -> None:
        """Make this the present state of the workspace, which the caller has drawn; what was undone is gone."""
        self.past, self.future = (*self.past[-200:], workspace), ()

    def undo(self) -> None:
        """One state back, if there is one."""
        if len(self.past) > 1:
            self.past, self.future = self.past[:-1], (self.past[-1], *self.future)
            self.say("undone")
            self.on_change()

    def redo(self) -> None:
        """One state on, if there is one."""
        if self.future:
            self.past, self.future = (*self.past, self.future[0]), self.future[1:]
            self.say("done again")
            self.on_change()

    def select(self, rows: Mask) -> None:
        """Select samples, in all plots."""
        self.selected = rows
        self.on_select()

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.start(f"opening {names[:80]}", lambda opened: self.take_opened(opened, names), open_paths, paths)

    def take_opened(self, opened: Opened, names: str) -> None:
        """Take over what was opened from files of these names."""
        workspace, profile = self.workspace, opened.profile
        fitted = None if workspace is None else workspace.fitted
        news: object = opened.bracket
        if opened.bracket is None and opened.workspace is None and profile is not None:  # beside the samples
            if fitted is not None and fitted.profile.camera != profile.camera:
                raise WorkspaceError(
                    f"{names}: a profile of {profile.camera}, which is not used, since this page has a model of "
                    f"{fitted.profile.camera}: open it in another tab of the browser"
                )
            if workspace is not None and str(workspace.samples.camera[0]) == profile.camera:
                self.put(with_profile(workspace, profile))
            news = f"profile of {profile.camera}"
            self.opened = replace(self.opened, profile=profile, profile_source=opened.profile_source, bracket=None)
        else:
            self.pictures_out, self.response, self.chosen, self.look_chosen, self.opened = (), None, None, False, opened
            self.begin(opened.workspace)
            if opened.bracket is None and opened.workspace is not None:
                samples = opened.workspace.samples
                news = f"{len(samples):,} samples of {len(np.unique(samples.shot))} shots"
        self.say(f"{names}: {news}")
        self.on_change()

    def fit(self, *kinds: str) -> None:
        """Fit models one after the other, each on those before it."""
        kind, *others = kinds
        workspace = self.require_workspace()
        if not workspace.has_raw:
            raise WorkspaceError("without RAW there is a response alone: press Fit response under Shots")
        task = workspace.task(kind)

        def done(fitted: FittedModel) -> None:
            now = self.require_workspace()
            if now.samples is not workspace.samples:
                raise WorkspaceError("other samples were opened meanwhile: compute again")
            news = f"{MODELS[kind]}: fitted to {int(task.rows.sum()):,} samples"
            self.change(now.with_model(kind, replace(fitted, task=task)), news)
            if others:
                self.fit(*others)

        self.start(MODELS[kind], done, fit_model, task, workspace.samples)

    def take_response(self, request: ResponseRequest, fitted: FittedResponse) -> None:
        """Take over what was fitted to a bracket."""
        self.response = request, fitted
        self.opened = replace(self.opened, profile=fitted.profile, profile_source=None)
        if self.workspace is not None:
            model = FittedModel(fitted.profile, predict(fitted.profile, self.workspace.samples))
            self.put(self.workspace.with_model("matrix", model))
        self.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
        self.on_change()

    def say(self, message: str, wrong: bool = False) -> None:
        """One line for the visitor, as text whatever it holds."""
        self._wrong = wrong
        role = "alert" if wrong else "status"
        style = ' style="color:var(--mui-palette-error-main);font-weight:600"' if wrong else ""
        self.status.object = f'<div role="{role}"{style}>{escape(" ".join(message.split())[:400])}</div>'

    def forget_error(self) -> None:
        """Take away what was wrong, as the visitor does something else."""
        if self._wrong:
            self.say("")

    def attempt(self, callback: Callable[..., None], *arguments: Any) -> None:
        """Call back, with errors as a line in the page."""
        try:
            callback(*arguments)
        except LutForgeError as error:
            self.say(str(error), wrong=True)
        except Exception as error:
            logging.getLogger("lutforge.studio").exception("in the page")
            self.say(f"this failed: {type(error).__name__}: {error}", wrong=True)

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback with its errors as a line in the page, and all that it changes as one message to the page."""

        @wraps(callback)
        def guarded(*arguments: Any) -> None:
            document = pn.state.curdoc or Document()

            def run() -> None:
                document.hold("combine")
                try:
                    self.attempt(callback, *arguments)
                finally:
                    document.unhold()

            # Panel may call without the document's lock, under which alone Bokeh's models can be changed.
            pn.state.execute(run, schedule=True)

        return guarded

    def button(self, label: str, action: Callable[[], None], **options: Any) -> pmui.Button:
        """A button with what it does, guarded."""

        def pressed(event: Any) -> None:
            self.forget_error()
            action()

        made = pmui.Button(label=label, size="small", **{"margin": (4, 4), "variant": "outlined", **options})
        made.on_click(self.guarded(pressed))
        return made

    @contextmanager
    def setting(self) -> Iterator[None]:
        """What a page sets meanwhile is no wish of the visitor: `watch` does not call back."""
        before, self.refreshing = self.refreshing, True
        try:
            yield
        finally:
            self.refreshing = before

    def watch(
        self, callback: Callable[[], None], *widgets: Any, of: str = "value", take: Callable[[Any], None] | None = None
    ) -> None:
        """Call back, guarded, when widgets change, a slider while it moves; once for several changes at a time.

        take: gets a new value at once, before anything that is drawn anew meanwhile sets the widget back.
        """
        due = False

        def run() -> None:
            nonlocal due
            due = False
            callback()

        soon = self.guarded(run)

        def changed(event: Any) -> None:
            nonlocal due
            if self.refreshing:
                return
            self.forget_error()
            if take is not None:
                self.attempt(take, event.new)
            if not due:
                due = True
                soon()

        for widget in widgets:
            widget.param.watch(changed, of)

    def bind(
        self, widget: Any, read: Callable[[Workspace], Any], put: Callable[[Workspace, Any], Workspace]
    ) -> Callable[[Workspace], None]:
        """Let a control change one thing of the workspace; what is returned shows that of a workspace in it.

        read: what the control shows of a workspace; put: a workspace with what it says instead.
        """

        def take(value: Any) -> None:
            if self.workspace is not None and read(self.workspace) != value:
                self.put(put(self.workspace, value))

        def show(workspace: Workspace) -> None:
            with self.setting():
                widget.value = read(workspace)

        self.watch(lambda: self.on_change(), widget, take=take)
        return show

    def start(
        self,
        title: str,
        done: Callable[[Any], None],
        function: Callable[..., Any],
        *arguments: Any,
        short: bool = False,
    ) -> None:
        """Work in another process; `done` gets its result. What is started meanwhile waits for its turn.

        short: work of seconds, beside what takes long; it takes the place of the last such work.
        """
        if pn.state.curdoc is None:  # no page waits for it
            done(function(*arguments, silent))
            return
        before = [work for work in self._works if work.short == short]
        if short:
            self._end(before)
        self._works.append(_Work(title, done, (function, *arguments), short))
        self.say(f"{title}: comes after {before[-1].title}" if before and not short else f"{title} …")
        self.progress.visible = self.cancel.visible = True
        if self._polling is None:
            self._polling = pn.state.add_periodic_callback(self.guarded(self.poll), period=120)
        self.poll()

    @property
    def is_busy(self) -> bool:
        """Whether short work is under way."""
        return any(work.short for work in self._works)

    def poll(self) -> None:
        """Begin the work whose turn it is, and take over what the jobs have reported."""
        if not pn.state.loaded:
            return  # Panel loses what changes while a page loads
        for short in (False, True):
            work = next((work for work in self._works if work.short == short), None)
            if work is None:
                continue
            if work.job is None:
                work.job = Job(*work.call)
            report = work.job.poll()
            if report.state == "running":
                share = "<progress aria-label='done' value='{}' style='width:100%'></progress>"
                self.progress.object = ui.html(share, f"{report.share:.2f}")
                if report.message != work.message:  # other news stay until there are new ones
                    work.message = report.message
                    self.say(f"{work.title}: {report.message}")
                continue
            self._end([work])
            if report.state == "done":
                self.attempt(work.done, report.result)
            else:
                self.say(f"{work.title}: {report.message}", wrong=True)

    def _end(self, works: list[_Work]) -> None:
        self._works = [work for work in self._works if work not in works]
        for work in works:
            if work.job is not None:
                work.job.cancel()
        self.progress.visible = self.cancel.visible = bool(self._works)
        if not self._works and self._polling is not None:
            self._polling.stop()
            self._polling = None

    def _cancel(self) -> None:
        """End what is under way, and what waits for it."""
        long = any(not work.short for work in self._works)
        ended = [work for work in self._works if work.short != long]
        self._end(ended)
        if ended:
            self.say(f"{', '.join(work.title for work in ended)}: cancelled")

    def close(self) -> None:
        """The visitor has gone."""
        self._end(self._works)


def usual_setting(profile: CameraProfile) -> str:
    """STYLE/WB of a camera as most want it: the style "standard", and the white balance that is nearest daylight."""
    known, daylight = profile.white_balances, NAMED_KELVIN["daylight"]
    nearest = min(known, key=lambda name: abs((known[name].kelvin or NAMED_KELVIN.get(name, 0.0)) - daylight))
    return f"{min(profile.styles, key=lambda name: name.lower() != 'standard')}/{nearest}"
