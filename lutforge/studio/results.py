"""Work in other processes whose results change the session: opened files, a fitted response, a fitted model."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from lutforge.pipeline.evaluation import predict
from lutforge.pipeline.response import FittedResponse
from lutforge.pipeline.response_request import ResponseRequest
from lutforge.samples.sample_set import SampleSet
from lutforge.studio.history import Change
from lutforge.studio.models import BASE_MODEL, MODEL_TITLES, FitTask, FittedModel, ModelKind, fit_model
from lutforge.studio.opening import Opened, open_paths
from lutforge.studio.session import Session
from lutforge.studio.undoable_state import UndoableState
from lutforge.studio.workspace import WorkspaceError, with_profile


def open_files(session: Session, paths: tuple[Path, ...]) -> None:
    """Open files or folders, in another process."""
    names = ", ".join(path.name for path in paths)
    session.work.start(f"opening {names[:80]}", lambda opened: take_opened(session, opened, names), open_paths, paths)


def take_opened(session: Session, opened: Opened, names: str) -> None:
    """Take over what was opened from files of these names: a profile joins the samples, else all is replaced."""
    is_profile = opened.bracket is None and opened.workspace is None and opened.profile is not None
    news = _add_profile(session, opened, names) if is_profile else _replace_everything(session, opened, names)
    session.page.say(f"{names}: {news}")
    session.page.on_change()


def _add_profile(session: Session, opened: Opened, names: str) -> str:
    """Use an opened profile, for the open samples where they are of its camera. Returns news.

    Raises WorkspaceError where the model in use is of another camera.
    """
    profile = opened.profile
    assert profile is not None
    before = session.state
    workspace = session.workspace
    was_empty = workspace is None and session.profile is None
    fitted = None if workspace is None else workspace.fitted
    if fitted is not None and fitted.profile.camera != profile.camera:
        raise WorkspaceError(
            f"{names}: a profile of {profile.camera}, which is not used, since this page has a model of "
            f"{fitted.profile.camera}: open it in another tab of the browser"
        )
    if workspace is not None and str(workspace.samples.camera[0]) == profile.camera:
        workspace = with_profile(workspace, profile)

    joined = replace(before.opened, profile=profile, profile_source=opened.profile_source, bracket=None)
    session.state = replace(before, workspace=workspace, opened=joined)
    if not was_empty:
        session.record_change(before, f"opening {names[:40]}", step="Shots")
    return f"profile of {profile.camera}"


def _replace_everything(session: Session, opened: Opened, names: str) -> str:
    """Begin with what was opened, in place of all that was there. Returns news."""
    before = session.state
    was_empty = session.workspace is None and session.profile is None
    session.state = UndoableState(opened=opened)
    session.start_over(opened.workspace)
    if not was_empty:
        name = f"opening {names[:40]}"
        session.history.add(Change("Shots", before, session.state, name, name, whole=True))
    if opened.bracket is not None or opened.workspace is None:
        return str(opened.bracket)
    samples = opened.workspace.samples
    return f"{len(samples):,} samples of {len(np.unique(samples.shot))} shots"


def take_response(session: Session, request: ResponseRequest, fitted: FittedResponse) -> None:
    """Take over what was fitted to a bracket."""
    before = session.state
    workspace = session.workspace
    if workspace is not None:
        model = FittedModel(fitted.profile, predict(fitted.profile, workspace.samples))
        workspace = workspace.with_model(BASE_MODEL, model)
    opened = replace(before.opened, profile=fitted.profile, profile_source=None)
    session.state = replace(before, workspace=workspace, opened=opened, response=(request, fitted))
    session.record_change(before, "fitting the response", step="Shots")
    session.page.say(f"response: fitted to {len(fitted.exposure_s)} pictures")
    session.page.on_change()


def fit_in_turn(session: Session, kind: ModelKind) -> None:
    """Fit a model, and before it the one that it stands on where that is stale when its turn has come."""
    if not session.require_workspace().has_raw:
        raise WorkspaceError("without RAW there is a response alone: press Fit response under Shots")
    fit = ModelFit(session, kind)
    session.work.start_in_turn(MODEL_TITLES[kind], fit.accept, fit.call)


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
        if task.stages is not None and workspace.is_stale(BASE_MODEL):
            task = workspace.task(BASE_MODEL)
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
            fit_in_turn(self.session, self.kind)
