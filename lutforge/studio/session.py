"""What one visitor has open: a workspace with its history, a look, what was written, and the work under way."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from functools import partial, wraps
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import panel as pn
import panel_material_ui as pmui

from lutforge.arrays import Mask
from lutforge.errors import LutForgeError
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.white_balance import NAMED_KELVIN
from lutforge.pipeline.charts import FittedChart
from lutforge.pipeline.predictions import predict
from lutforge.pipeline.response import FittedResponse
from lutforge.studio import ui
from lutforge.studio.jobs import Job
from lutforge.studio.opening import BracketRequest, Folders, Opened, open_paths
from lutforge.studio.workspace import MODELS, FittedModel, History, Workspace, WorkspaceError, fit_model, with_profile


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
    """A job, under way or waiting: what gets its result, the callback that asks for it, and what it last said."""

    title: str
    done: Callable[[Any], None]
    call: tuple[Any, ...]
    job: Job | None = None
    poll: Any = None
    said: str = ""


class Session:
    """Shared by the steps of one page, which are told of each change.

    opened: where the samples, the bracket and a profile that is not of this visit come from; chosen: the look that is
    shown, None before; look_chosen: whether the visitor chose it; written: by kind of export the last file;
    pictures_out: the names of the pictures of a bracket that take no part; response: what was asked for and fitted to
    them.
    """

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self.history: History | None = None
        self.selected: Mask = np.zeros(0, dtype=np.bool_)
        self.opened = Opened()
        self.chosen: ChosenLook | None = None
        self.look_chosen = False
        self.pictures_out: tuple[str, ...] = ()
        self.response: tuple[BracketRequest, FittedResponse | FittedChart] | None = None
        self.written: dict[str, Written] = {}
        self.on_change: Callable[[], None] = lambda: None
        self.on_look: Callable[[], None] = lambda: None
        self.on_select: Callable[[], None] = lambda: None
        self.refreshing = False
        self._wrong = False
        self._asked: list[Callable[[], None]] = []  # callbacks of widgets that the visitor has moved
        self._works: dict[str, list[_Work]] = {"long": [], "short": []}  # the first of each is under way
        self.status = ui.text(margin=(2, 12), height=22)
        self.progress = ui.text(visible=False, sizing_mode="fixed", width=200, height=24, margin=(4, 8))
        self.cancel = self.button("Cancel", self._cancel, visible=False)

    # --- state -------------------------------------------------------------------------------------------------------

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
    def look(self) -> ChosenLook:
        """The look that is shown, else the camera's usual one, where there is a profile."""
        return self.chosen or ChosenLook(target=usual_setting(self.profile) if self.has_profile else "")

    @property
    def made(self) -> tuple[CameraProfile | None, ChosenLook]:
        """What is written is made from: the profile, None where there is none, and the look."""
        return self.profile if self.has_profile else None, self.look

    def is_old(self, written: Written) -> bool:
        """Whether a file is of another profile or look than the present ones, or its model is stale."""
        return self.is_stale or written.of[0] is not self.made[0] or written.of[1] != self.look

    def change(self, workspace: Workspace, news: str = "") -> None:
        """Make this the present state of the workspace, and tell the news, if there are any."""
        assert self.history is not None
        self._move(self.history.do(workspace), news)

    def undo(self) -> None:
        """One state back."""
        if self.history is not None and self.history.past:
            self._move(self.history.undo(), "undone")

    def redo(self) -> None:
        """One state on."""
        if self.history is not None and self.history.future:
            self._move(self.history.redo(), "done again")

    def _move(self, history: History, news: str) -> None:
        self.history = history
        if news:
            self.say(news)
        self.on_change()

    def select(self, rows: Mask) -> None:
        """Select samples, in all plots."""
        self.selected = rows
        self.on_select()

    # --- opening and fitting -----------------------------------------------------------------------------------------

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.start(f"opening {names[:80]}", lambda opened: self._opened(opened, names), open_paths, paths)

    def _opened(self, opened: Opened, names: str) -> None:
        if opened.bracket is None and opened.workspace is None:  # a profile, beside the samples that are open
            assert opened.profile is not None
            if self.history is not None and str(self.workspace.samples.camera[0]) == opened.profile.camera:
                self.history = self.history.do(with_profile(self.workspace, opened.profile))
            self.say(f"{names}: profile of {opened.profile.camera}")
            self.opened = replace(
                self.opened, profile=opened.profile, profile_source=opened.profile_source, bracket=None
            )
        else:
            self.pictures_out, self.response, self.chosen, self.look_chosen, self.opened = (), None, None, False, opened
            self.history = None if opened.workspace is None else History(opened.workspace)
            self.selected = np.zeros(0 if opened.workspace is None else len(opened.workspace.samples), dtype=np.bool_)
            if opened.bracket is not None:
                self.say(f"{names}: {opened.bracket}")
            elif opened.workspace is not None:
                shots = len(np.unique(opened.workspace.samples.shot))
                self.say(f"{names}: {len(opened.workspace.samples):,} samples of {shots} shots")
        self.on_change()

    def fit(self, *kinds: str) -> None:
        """Fit models one after the other, each on those before it."""
        kind, *others = kinds
        workspace = self.workspace
        if not workspace.has_raw:
            raise WorkspaceError("without RAW there is a response alone: press Fit response under Shots")
        task = workspace.task(kind)

        def done(fitted: FittedModel) -> None:
            now = self.workspace
            if now.samples is not workspace.samples:
                raise WorkspaceError("other samples were opened meanwhile: compute again")
            news = f"{MODELS[kind]}: fitted to {int(task.rows.sum()):,} samples"
            self.change(now.with_model(kind, replace(fitted, task=task)), news)
            if others:
                self.fit(*others)

        self.start(MODELS[kind], done, fit_model, task, workspace.samples)

    def take_response(self, request: BracketRequest, fitted: FittedResponse | FittedChart) -> None:
        """Take over what was fitted to a bracket."""
        self.response = request, fitted
        self.opened = replace(self.opened, profile=fitted.profile, profile_source=None)
        if self.history is not None:
            model = FittedModel(fitted.profile, predict(fitted.profile, self.workspace.samples))
            self.history = self.history.do(self.workspace.with_model("matrix", model))
        self.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
        self.on_change()

    # --- news --------------------------------------------------------------------------------------------------------

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

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback with its errors as a line in the page, and all that it changes as one message to the page."""

        def run(*arguments: Any) -> None:
            due: list[Callable[[], None]] = [*self._asked, partial(callback, *arguments)]
            self._asked = []  # what a visitor has set comes before what draws it anew
            for one in due:
                try:
                    one()
                except LutForgeError as error:
                    self.say(str(error), wrong=True)
                except Exception as error:
                    logging.getLogger("lutforge.studio").exception("in the page")
                    self.say(f"this failed: {type(error).__name__}: {error}", wrong=True)

        @wraps(callback)
        def guarded(*arguments: Any) -> None:
            document = served_document()
            if document is None:
                run(*arguments)
                return

            def held() -> None:
                document.hold("combine")
                try:
                    run(*arguments)
                finally:
                    document.unhold()

            # Panel may call without the document's lock, under which alone Bokeh's models can be changed.
            document.add_next_tick_callback(held)

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

    def watch(self, callback: Callable[[], None], *widgets: Any, of: str = "value") -> None:
        """Call back, guarded, when widgets change, a slider while it moves; once for several changes at a time."""

        def run() -> None:
            self.forget_error()
            callback()

        soon = self.guarded(lambda: None)

        def changed(event: Any) -> None:
            if run not in self._asked and not self.refreshing:
                self._asked.append(run)
                soon()

        for widget in widgets:
            widget.param.watch(changed, of)

    def bind(
        self, widget: Any, read: Callable[[Workspace], Any], put: Callable[[Workspace, Any], Workspace]
    ) -> Callable[[Workspace], None]:
        """Let a control change one thing of the workspace; what is returned shows that of a workspace in it.

        read: what the control shows of a workspace; put: a workspace with what it says instead.
        """
        wishes: list[Any] = []  # as asked: what is drawn anew before the callback is due may set the control back

        def wish(event: Any) -> None:
            wishes[:] = wishes if self.refreshing else [event.new]

        def changed() -> None:
            if self.history is not None and wishes and read(self.workspace) != wishes[0]:
                self.change(put(self.workspace, wishes[0]))

        def show(workspace: Workspace) -> None:
            with self.setting():
                widget.value = read(workspace)

        widget.param.watch(wish, "value")
        self.watch(changed, widget)
        return show

    def rested(self, callback: Callable[[], None]) -> Callable[[], None]:
        """The callback, guarded, once for many calls, a fifth of a second after the last of them."""
        run, waiting = self.guarded(callback), list[Any]()

        def later() -> None:
            document = served_document()
            if document is None:
                run()
                return
            for one in waiting:
                with suppress(ValueError):  # it has been called
                    document.remove_timeout_callback(one)
            waiting[:] = [document.add_timeout_callback(run, 200)]

        return later

    # --- work --------------------------------------------------------------------------------------------------------

    def start(self, title: str, done: Callable[[Any], None], function: Callable[..., Any], *arguments: Any) -> None:
        """Work in another process; `done` gets its result. What is started meanwhile waits for its turn."""
        waiting = self._works["long"]
        waiting.append(_Work(title, done, (function, *arguments)))
        if len(waiting) > 1:
            self.say(f"{title}: comes after {waiting[-2].title}")
        else:
            self._begin("long")

    def start_short(
        self, title: str, done: Callable[[Any], None], function: Callable[..., Any], *arguments: Any
    ) -> None:
        """Work of seconds in another process, beside what takes long; it takes the place of the last such work."""
        for work in self._works["short"]:
            self._end("short", work)
        self._works["short"] = [_Work(title, done, (function, *arguments))]
        self._begin("short")

    @property
    def is_busy(self) -> bool:
        """Whether short work is under way."""
        return bool(self._works["short"])

    def _begin(self, kind: str) -> None:
        work = self._works[kind][0]
        work.job = Job(work.title, *work.call)
        self.say(f"{work.title} …")
        self._share(0.0)
        self.progress.visible = self.cancel.visible = True
        if pn.state.curdoc is not None:
            work.poll = pn.state.add_periodic_callback(self.guarded(lambda: self.poll(kind)), period=120)

    def _end(self, kind: str, work: _Work) -> None:
        self._works[kind].remove(work)
        if work.poll is not None:
            work.poll.stop()
        if work.job is not None:
            work.job.cancel()
        self.progress.visible = self.cancel.visible = any(self._works.values())

    def poll(self, kind: str) -> None:
        """Take over what the job of a kind has reported."""
        if not self._works[kind] or (job := self._works[kind][0].job) is None:
            return
        work, report = self._works[kind][0], job.report
        if report.state == "running":
            self._share(report.share)
            if report.message != work.said:  # other news stay until there are new ones
                work.said = report.message
                self.say(f"{work.title}: {report.message}")
            return
        self._end(kind, work)
        try:
            if report.state == "done":
                work.done(report.result)
            else:
                self.say(f"{work.title}: {report.message}", wrong=report.state == "failed")
        finally:
            if self._works[kind]:
                self._begin(kind)

    def _share(self, done: float) -> None:
        self.progress.object = ui.html(
            "<progress aria-label='done' value='{}' style='width:100%'></progress>", f"{done:.2f}"
        )

    def _cancel(self) -> None:
        """End what is under way, and what waits for it."""
        kind = "long" if self._works["long"] else "short"
        titles = [work.title for work in self._works[kind]]
        for work in list(self._works[kind]):
            self._end(kind, work)
        if titles:
            self.say(f"{', '.join(titles)}: cancelled")

    def close(self) -> None:
        """The visitor has gone."""
        for works in self._works.values():
            for work in works:
                if work.job is not None:
                    work.job.cancel()


def served_document() -> Any:
    """The document of the page that is being served; None without one, as in a script."""
    document = pn.state.curdoc
    return None if document is None or document.session_context is None else document


def usual_setting(profile: CameraProfile) -> str:
    """STYLE/WB of a camera as most want it: the style "standard", and the white balance that is nearest daylight."""
    known, daylight = profile.white_balances, NAMED_KELVIN["daylight"]
    nearest = min(known, key=lambda name: abs((known[name].kelvin or NAMED_KELVIN.get(name, 0.0)) - daylight))
    return f"{min(profile.styles, key=lambda name: name.lower() != 'standard')}/{nearest}"
