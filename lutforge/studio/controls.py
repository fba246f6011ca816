"""The controls of a page and the session: what they change can be undone, and the next page has their values."""

from collections.abc import Callable, Sequence
from typing import Any

from lutforge.studio import ui
from lutforge.studio.session import Session
from lutforge.studio.workspace import Workspace


def bind(
    session: Session, widget: Any, read: Callable[[Workspace], Any], put: Callable[[Workspace, Any], Workspace]
) -> Callable[[Workspace], None]:
    """Let a control change one thing of the workspace; what is returned shows that of a workspace in it.

    read: what the control shows of a workspace; put: a workspace with what it says instead.
    """

    def take(value: Any) -> None:
        if session.workspace is not None and read(session.workspace) != value:
            key = widget.label if hasattr(widget, "value_throttled") else ""
            before = session.history.before_move(session.step, key, session.state).workspace
            old, new = (as_text(widget, shown) for shown in (read(before or session.workspace), value))
            name = f"{widget.label}: {new} → {old}"
            again = f"{widget.label}: {old} → {new}"
            session.commit_workspace(put(session.workspace, value), name, again, key)

    def show(workspace: Workspace) -> None:
        with session.page.setting():
            widget.value = read(workspace)

    session.page.watch(lambda: session.page.on_change(), widget, take=take)
    end_moves_of(session, widget)
    return show


def end_moves_of(session: Session, *widgets: Any) -> None:
    """Let each move of a slider, from press to release, be one change."""
    for widget in widgets:
        if hasattr(widget, "value_throttled"):
            widget.param.watch(lambda event: session.history.end_move(), "value_throttled")


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


def remember_controls(session: Session, step: str, controls: Sequence[Any]) -> bool:
    """Let controls of a step be as the page before has left them, and remember their values for the next page.

    Returns whether any value was remembered. Text is remembered letter by letter, before it is confirmed.
    """
    was_remembered = False
    for place, control in enumerate(controls):
        key = (step, place)
        parameter = "value_input" if hasattr(control, "value_input") else "value"
        if key in session.control_values:
            was_remembered = True
            with session.page.setting():
                ui.set_possible(control, session.control_values[key])
        control.param.watch(lambda event, key=key: session.control_values.update({key: event.new}), parameter)
    return was_remembered
