"""The session of a visitor: a workspace with its history, a look, files that were written, and work under way.

A session outlives the page that shows it: a page is attached to it, and detached when its tab is closed.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
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
from lutforge.samples.sample_set import SampleSet
from lutforge.studio import ui
from lutforge.studio.background import Background
from lutforge.studio.folders import Folders
from lutforge.studio.history import Change, History, exchanged
from lutforge.studio.models import MATRIX, MODEL_TITLES, NO_MODEL, FitTask, FittedModel, ModelKind, fit_model
from lutforge.studio.opening import Opened, open_paths
from lutforge.studio.page_link import PageLink
from lutforge.studio.workspace import Workspace, WorkspaceError, with_profile


@dataclass(frozen=True, eq=False)
class Written:
    """A file that was written. kind: of export; lines: on its contents; command: the command line that writes it.

    profile, look: those that it was made from.
    """

    kind: str
    path: Path
    lines: tuple[str, ...]
    command: str
    profile: CameraProfile | None
    look: ChosenLook


@dataclass(frozen=True, eq=False)
class UndoableState:
    """The part of a session that Undo and Redo change, all of it in one record.

    opened: where the samples, the bracket and a profile that is not of this visit come from; chosen: the look that is
    shown, None before; look_chosen: whether the visitor chose it; look_controls: the values of the controls of Look, by
    name; pictures_out: the names of the pictures of a bracket that take no part; response: what was asked for and
    fitted to them.
    """

    workspace: Workspace | None = None
    opened: Opened = field(default_factory=Opened)
    chosen: ChosenLook | None = None
    look_chosen: bool = False
    look_controls: Mapping[str, Any] = field(default_factory=dict)
    pictures_out: tuple[str, ...] = ()
    response: tuple[ResponseRequest, FittedResponse] | None = None

    def exchanged(self, old: "UndoableState", new: "UndoableState") -> "UndoableState":
        """This state with what differs between two others, as the second of them has it.

        A workspace changes field by field, and Look control by control: what else they hold stays as it is here.
        """
        state = exchanged(self, old, new)
        moved = {name: value for name, value in new.look_controls.items() if old.look_controls.get(name) != value}
        state = replace(state, look_controls={**self.look_controls, **moved})
        if self.workspace is None or old.workspace is None or new.workspace is None:
            return state
        return replace(state, workspace=exchanged(self.workspace, old.workspace, new.workspace))


class Session:
    """The work of one visitor, which outlives the page that shows it.

    state: what can be undone; a change replaces it. selected: (n,) the samples that are selected in all plots.
    photograph: the one that Look shows; is_unseen: whether the look cannot be applied to it yet. look_view: what the
    view of Look shows, by its parameters' names. written: by kind of export the last file; own_files: all that were
    written, which may be replaced unasked. dropped: the folder of files that were dropped. step: the one that is seen.
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
        self.dropped: TemporaryDirectory[str] | None = None
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

    def remember_controls(self, step: str, controls: Sequence[Any]) -> bool:
        """Let controls of a step be as the page before has left them, and remember their values for the next page.

        Returns whether any value was remembered. Text is remembered letter by letter, before it is confirmed.
        """
        was_remembered = False
        for place, control in enumerate(controls):
            key = (step, place)
            parameter = "value_input" if hasattr(control, "value_input") else "value"
            if key in self.control_values:
                was_remembered = True
                with self.page.setting():
                    ui.set_possible(control, self.control_values[key])
            control.param.watch(lambda event, key=key: self.control_values.update({key: event.new}), parameter)
        return was_remembered

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
        return self.is_stale or written.profile is not self.profile or written.look != self.look

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

    def open(self, paths: tuple[Path, ...]) -> None:
        """Open files or folders, in another process."""
        names = ", ".join(path.name for path in paths)
        self.work.start(f"opening {names[:80]}", lambda opened: self.take_opened(opened, names), open_paths, paths)

    def take_opened(self, opened: Opened, names: str) -> None:
        """Take over what was opened from files of these names: a profile joins the samples, else all is replaced."""
        is_profile = opened.bracket is None and opened.workspace is None and opened.profile is not None
        news = self._add_profile(opened, names) if is_profile else self._replace_everything(opened, names)
        self.page.say(f"{names}: {news}")
        self.page.on_change()

    def _add_profile(self, opened: Opened, names: str) -> str:
        """Use an opened profile, for the open samples where they are of its camera. Returns news.

        Raises WorkspaceError where the model in use is of another camera.
        """
        profile = opened.profile
        assert profile is not None
        before = self.state
        workspace = self.workspace
        was_empty = workspace is None and self.profile is None
        fitted = None if workspace is None else workspace.fitted
        if fitted is not None and fitted.profile.camera != profile.camera:
            raise WorkspaceError(
                f"{names}: a profile of {profile.camera}, which is not used, since this page has a model of "
                f"{fitted.profile.camera}: open it in another tab of the browser"
            )
        if workspace is not None and str(workspace.samples.camera[0]) == profile.camera:
            workspace = with_profile(workspace, profile)

        joined = replace(before.opened, profile=profile, profile_source=opened.profile_source, bracket=None)
        self.state = replace(before, workspace=workspace, opened=joined)
        if not was_empty:
            self.record_change(before, f"opening {names[:40]}", step="Shots")
        return f"profile of {profile.camera}"

    def _replace_everything(self, opened: Opened, names: str) -> str:
        """Begin with what was opened, in place of all that was there. Returns news."""
        before = self.state
        was_empty = self.workspace is None and self.profile is None
        self.state = UndoableState(opened=opened)
        self.start_over(opened.workspace)
        if not was_empty:
            name = f"opening {names[:40]}"
            self.history.add(Change("Shots", before, self.state, name, name, whole=True))
        if opened.bracket is not None or opened.workspace is None:
            return str(opened.bracket)
        samples = opened.workspace.samples
        return f"{len(samples):,} samples of {len(np.unique(samples.shot))} shots"

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

    def fit(self, kind: ModelKind) -> None:
        """Fit a model, and before it the one that it stands on where that is stale when its turn has come."""
        if not self.require_workspace().has_raw:
            raise WorkspaceError("without RAW there is a response alone: press Fit response under Shots")
        fit = ModelFit(self, kind)
        self.work.start_in_turn(MODEL_TITLES[kind], fit.accept, fit.call)

    def take_response(self, request: ResponseRequest, fitted: FittedResponse) -> None:
        """Take over what was fitted to a bracket."""
        before = self.state
        workspace = self.workspace
        if workspace is not None:
            model = FittedModel(fitted.profile, predict(fitted.profile, workspace.samples))
            workspace = workspace.with_model(MATRIX, model)
        opened = replace(before.opened, profile=fitted.profile, profile_source=None)
        self.state = replace(before, workspace=workspace, opened=opened, response=(request, fitted))
        self.record_change(before, "fitting the response", step="Shots")
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
                self.commit_workspace(put(self.workspace, value), name, again, key)

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


class ModelFit:
    """A fit of one kind of model, from the moment when its turn has come until the session has its result."""

    def __init__(self, session: Session, kind: ModelKind) -> None:
        self.session = session
        self.kind = kind

    def call(self) -> tuple[Callable[..., FittedModel], FitTask, SampleSet]:
        """The function to run in another process, and its arguments, as the workspace is now.

        They are of the model that this kind stands on where that is stale.
        """
        workspace = self.session.require_workspace()
        task = workspace.task(self.kind)
        if task.stages is not None and workspace.is_stale(MATRIX):
            task = workspace.task(MATRIX)
        self.task = task
        self.samples = workspace.samples
        return fit_model, task, workspace.samples

    def accept(self, fitted: FittedModel) -> None:
        """Take over the model, and go on with that of this kind. Raises WorkspaceError where the samples are others."""
        workspace = self.session.require_workspace()
        if workspace.samples is not self.samples:
            raise WorkspaceError("other samples were opened meanwhile: compute again")
        kind = self.task.kind
        news = f"{MODEL_TITLES[kind]}: fitted to {int(self.task.rows.sum()):,} samples"
        self.session.change_workspace(workspace.with_model(kind, replace(fitted, task=self.task)), news, step="Model")
        if kind != self.kind:
            self.session.fit(self.kind)


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
