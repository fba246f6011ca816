"""The session of a visitor: a workspace with its history, a look, files that were written, and work under way.

A session outlives the page that shows it: a page is attached to it, and detached when its tab is closed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from lutforge.arrays import Mask
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.evaluation import predict
from lutforge.pipeline.looks import ChosenLook, usual_setting
from lutforge.pipeline.photographs import Photograph
from lutforge.pipeline.response import FittedResponse
from lutforge.pipeline.response_request import ResponseRequest
from lutforge.studio import ui
from lutforge.studio.background import Background
from lutforge.studio.history import Change, History, exchanged
from lutforge.studio.opening import Folders, Opened, open_paths
from lutforge.studio.page_link import PageLink
from lutforge.studio.workspace import MODEL_TITLES, FittedModel, Workspace, WorkspaceError, fit_model, with_profile


@dataclass(frozen=True, eq=False)
class Written:
    """A file that was written. kind: of export; lines: on its contents; command: the command line that writes it.

    of: the profile and the look that it was made from.
    """

    kind: str
    path: Path
    lines: tuple[str, ...]
    command: str
    of: tuple[CameraProfile | None, ChosenLook]


@dataclass(frozen=True, eq=False)
class State:
    """The part of a session that can be undone. look_controls: of Look, by name; the others as in `Session`."""

    workspace: Workspace | None
    opened: Opened
    chosen: ChosenLook | None
    look_chosen: bool
    look_controls: Mapping[str, Any]
    pictures_out: tuple[str, ...]
    response: tuple[ResponseRequest, FittedResponse] | None


class Session:
    """Shared by the steps of one page, which are told of each change.

    opened: where the samples, the bracket and a profile that is not of this visit come from; chosen: the look that is
    shown, None before; look_chosen: whether the visitor chose it; written: by kind of export the last file;
    pictures_out: the names of the pictures of a bracket that take no part; response: what was asked for and fitted to
    them; photograph: the one that Look shows, which outlives its page.
    """

    def __init__(self, folders: Folders) -> None:
        self.folders = folders
        self.workspace: Workspace | None = None
        self.selected: Mask = np.zeros(0, dtype=np.bool_)
        self.opened = Opened()
        self.chosen: ChosenLook | None = None
        self.look_chosen = False
        self.is_unseen = False  # whether a photograph is shown to which the look cannot be applied yet
        self.look_controls: Mapping[str, Any] = {}
        self.pictures_out: tuple[str, ...] = ()
        self.response: tuple[ResponseRequest, FittedResponse] | None = None
        self.written: dict[str, Written] = {}
        self.photograph: Photograph | None = None
        self.dropped: TemporaryDirectory[str] | None = None
        self.step = "Shots"
        self.kept: dict[tuple[str, int], Any] = {}  # by step and place, of controls that are of no state
        self.look_view: dict[str, Any] = {}
        self.own_files: set[Path] = set()  # what was written, which may be written again unasked
        self.history = History()
        self.work = Background()
        self.page = PageLink()
        self.attach()

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

    def keep(self, step: str, controls: Sequence[Any]) -> bool:
        """Let controls of a step be as the page before has left them, and keep them for the next.

        Returns whether any was kept. What is written into a line is kept letter by letter.
        """
        was_kept = False
        for place, control in enumerate(controls):
            name, of = (step, place), "value_input" if hasattr(control, "value_input") else "value"
            if name in self.kept:
                was_kept = True
                with self.page.setting():
                    ui.set_possible(control, self.kept[name])
            control.param.watch(lambda event, name=name: self.kept.update({name: event.new}), of)
        return was_kept

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

    @property
    def state(self) -> State:
        """The part of this session that can be undone, as it is now."""
        return State(**{field.name: getattr(self, field.name) for field in fields(State)})

    def _restore(self, state: State) -> None:
        if state.workspace is not self.workspace:
            self._select_nothing(state.workspace)
        for field in fields(State):
            setattr(self, field.name, getattr(state, field.name))
        self.page.on_change()

    def _select_nothing(self, workspace: Workspace | None) -> None:
        count = 0 if workspace is None else len(workspace.samples)
        if len(self.selected) != count:
            self.selected = np.zeros(count, dtype=np.bool_)

    def begin(self, workspace: Workspace | None) -> None:
        """Make this the first state of the workspace."""
        self.workspace = workspace
        self.history = History()
        self.selected = np.zeros(0 if workspace is None else len(workspace.samples), dtype=np.bool_)

    def change(self, workspace: Workspace, news: str = "", step: str = "") -> None:
        """Make this the present state of the workspace, and show the news, if there are any."""
        self.put(workspace, news or "change", step=step)
        if news:
            self.page.say(news)
        self.page.on_change()

    def put(self, workspace: Workspace, name: str = "change", again: str = "", key: str = "", step: str = "") -> None:
        """Make this the present state of the workspace, which the caller has drawn.

        name, again: the change as Undo and Redo offer it; key: of a control that is still moving; step: the present
        one if not given.
        """
        before = self.state
        self.workspace = workspace
        self.note(before, name, again, key, step)

    def note(self, before: State, name: str, again: str = "", key: str = "", step: str = "") -> None:
        """Let a change that was made since `before` be undone."""
        self.history.add(Change(step or self.step, before, self.state, name, again or name, key))

    def undo(self) -> None:
        """Take back the last change of the step that is seen, if there is one."""
        change = self.history.last(self.step)
        if change is not None:
            self.page.say(f"undone: {change.name}")
            self._restore(self._exchange(change, self.history.undo, change.after, change.before))

    def redo(self) -> None:
        """Make the change again that was undone last in the step that is seen, if there is one."""
        change = self.history.next(self.step)
        if change is not None:
            self.page.say(f"done again: {change.again}")
            self._restore(self._exchange(change, self.history.redo, change.before, change.after))

    def _exchange(self, change: Change, move: Callable[[str, State], State], old: State, new: State) -> State:
        """The state after a move in the history; a workspace changes field by field, and Look control by control."""
        now = self.state
        state = move(self.step, now)
        if change.whole:
            return state

        moved = {name: value for name, value in new.look_controls.items() if old.look_controls.get(name) != value}
        state = replace(state, look_controls={**now.look_controls, **moved})
        if old.workspace is None or new.workspace is None or now.workspace is None:
            return state
        return replace(state, workspace=exchanged(now.workspace, old.workspace, new.workspace))

    def select(self, rows: Mask) -> None:
        """Select samples, in all plots."""
        self.selected = rows
        self.page.on_select()

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.work.start(f"opening {names[:80]}", lambda opened: self.take_opened(opened, names), open_paths, paths)

    def take_opened(self, opened: Opened, names: str) -> None:
        """Take over what was opened from files of these names."""
        workspace = self.workspace
        profile = opened.profile
        fitted = None if workspace is None else workspace.fitted
        news: object = opened.bracket
        name = f"opening {names[:40]}"
        before = self.state
        was_empty = workspace is None and self.profile is None
        if opened.bracket is None and opened.workspace is None and profile is not None:  # beside the samples
            if fitted is not None and fitted.profile.camera != profile.camera:
                raise WorkspaceError(
                    f"{names}: a profile of {profile.camera}, which is not used, since this page has a model of "
                    f"{fitted.profile.camera}: open it in another tab of the browser"
                )
            if workspace is not None and str(workspace.samples.camera[0]) == profile.camera:
                self.workspace = with_profile(workspace, profile)
            news = f"profile of {profile.camera}"
            self.opened = replace(self.opened, profile=profile, profile_source=opened.profile_source, bracket=None)
            if not was_empty:
                self.note(before, name, step="Shots")
        else:
            self.pictures_out = ()
            self.response = None
            self.chosen = None
            self.look_chosen = False
            self.opened = opened
            self.look_controls = {}
            self.begin(opened.workspace)
            if not was_empty:
                self.history.add(Change("Shots", before, self.state, name, name, whole=True))
            if opened.bracket is None and opened.workspace is not None:
                samples = opened.workspace.samples
                news = f"{len(samples):,} samples of {len(np.unique(samples.shot))} shots"
        self.page.say(f"{names}: {news}")
        self.page.on_change()

    def dropped_folder(self, purpose: str) -> Path | None:
        """The folder of what was dropped for a purpose; None where nothing was."""
        folder = None if self.dropped is None else Path(self.dropped.name) / purpose
        return folder if folder is not None and folder.is_dir() else None

    def keep_dropped(self, purpose: str, names: Any, contents: Any) -> tuple[Path, ...]:
        """Write files that were dropped into a folder of this session, one for each purpose. Returns their paths.

        names, contents: of a file, or lists of several. Raises WorkspaceError where a name is none.
        """
        if self.dropped is None:
            self.dropped = TemporaryDirectory(prefix="lutforge_dropped_")
        folder = Path(self.dropped.name) / purpose
        folder.mkdir(exist_ok=True)
        pairs = zip(names, contents, strict=True) if isinstance(names, list) else [(names, contents)]
        paths = []
        for name, data in pairs:
            bare = Path(str(name).replace("\\", "/")).name
            if not bare or bare.startswith("."):
                raise WorkspaceError(f"{str(name)[:60]!r}: not a file name")
            paths.append(folder / bare)
            paths[-1].write_bytes(data)
        return tuple(paths)

    def fit(self, kind: str) -> None:
        """Fit a model, and before it the one that it stands on where that is stale when its turn has come."""
        workspace = self.require_workspace()
        task = workspace.task(kind)
        if not workspace.has_raw:
            raise WorkspaceError("without RAW there is a response alone: press Fit response under Shots")

        def call() -> tuple[Any, ...]:
            nonlocal workspace, task
            workspace = self.require_workspace()
            task = workspace.task(kind)
            if task.stages is not None and workspace.is_stale("matrix"):
                task = workspace.task("matrix")
            return fit_model, task, workspace.samples

        def done(fitted: FittedModel) -> None:
            now = self.require_workspace()
            if now.samples is not workspace.samples:
                raise WorkspaceError("other samples were opened meanwhile: compute again")
            news = f"{MODEL_TITLES[task.kind]}: fitted to {int(task.rows.sum()):,} samples"
            self.change(now.with_model(task.kind, replace(fitted, task=task)), news, step="Model")
            if task.kind != kind:
                self.fit(kind)

        self.work.start_in_turn(MODEL_TITLES[kind], done, call)

    def take_response(self, request: ResponseRequest, fitted: FittedResponse) -> None:
        """Take over what was fitted to a bracket."""
        before = self.state
        self.response = request, fitted
        self.opened = replace(self.opened, profile=fitted.profile, profile_source=None)
        if self.workspace is not None:
            model = FittedModel(fitted.profile, predict(fitted.profile, self.workspace.samples))
            self.workspace = self.workspace.with_model("matrix", model)
        self.note(before, "fitting the response", step="Shots")
        self.page.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
        self.page.on_change()

    def bind(
        self, widget: Any, read: Callable[[Workspace], Any], put: Callable[[Workspace, Any], Workspace]
    ) -> Callable[[Workspace], None]:
        """Let a control change one thing of the workspace; what is returned shows that of a workspace in it.

        read: what the control shows of a workspace; put: a workspace with what it says instead.
        """

        def take(value: Any) -> None:
            if self.workspace is not None and (before := read(self.workspace)) != value:
                old, new = (as_text(widget, shown) for shown in (before, value))
                name = f"{widget.label}: {new} → {old}"
                again = f"{widget.label}: {old} → {new}"
                key = widget.label if hasattr(widget, "value_throttled") else ""
                self.put(put(self.workspace, value), name, again, key)

        def show(workspace: Workspace) -> None:
            with self.page.setting():
                widget.value = read(workspace)

        self.page.watch(lambda: self.page.on_change(), widget, take=take)
        self.end_moves_of(widget)
        return show

    def end_moves_of(self, *widgets: Any) -> None:
        """Let each move of a slider, from press to release, be one change."""
        for widget in widgets:
            if hasattr(widget, "value_throttled"):
                widget.param.watch(lambda event: self.history.end_move(), "value_throttled")

    def close(self) -> None:
        """End all jobs, and remove the files that were dropped: the session cannot be continued."""
        self.work.queue.end(self.work.queue.works)
        self.detach()
        if self.dropped is not None:
            self.dropped.cleanup()
            self.dropped = None


def as_text(widget: Any, value: Any) -> str:
    """A value of a control, as it shows it."""
    if isinstance(value, tuple):
        return " – ".join(f"{number:g}" for number in value)
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, int | float) and not hasattr(widget, "options"):
        return f"{value:+g}" if getattr(widget, "start", 0) < 0 < value else f"{value:g}"
    if isinstance(value, list):
        return f"{len(value)} ticked"
    options = getattr(widget, "options", None)
    named = options.items() if isinstance(options, dict) else ()
    return next((label for label, option in named if option == value), str(value) or "–")
