"""The link of a session to the page that shows it: news, and callbacks of controls, guarded against errors."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import wraps
from typing import Any

import panel as pn
import panel_material_ui as pmui
from bokeh.document import Document

from lutforge.errors import LutForgeError
from lutforge.studio.status import StatusLine


class PageLink:
    """The side of a page that its session and its controls call. A link without a page does nothing.

    on_change, on_look, on_select: what the page draws when the workspace, the look or the selection has changed;
    refreshing: whether the page is setting its controls by itself.
    """

    def __init__(self) -> None:
        self.on_change: Callable[[], None] = lambda: None
        self.on_look: Callable[[], None] = lambda: None
        self.on_select: Callable[[], None] = lambda: None
        self.refreshing = False
        self.status = StatusLine()

    def say(self, message: str, wrong: bool = False, job: str = "") -> None:
        """One line for the visitor, as text whatever it holds. job: the title of a job that failed."""
        self.status.say(message, wrong, job)

    def forget_errors(self, *jobs: str) -> None:
        """Take away the errors of jobs by their titles, "" for those of what the visitor did; by default all."""
        self.status.forget_errors(*jobs)

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
            self.forget_errors()
            action()

        button = pmui.Button(label=label, size="small", **{"margin": (4, 4), "variant": "outlined", **options})
        button.on_click(self.guarded(pressed))
        return button

    @contextmanager
    def setting(self) -> Iterator[None]:
        """Set controls without being called back by `watch`: it is no wish of the visitor."""
        before = self.refreshing
        self.refreshing = True
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
            self.forget_errors("")
            if take is not None:
                self.attempt(take, event.new)
            if not due:
                due = True
                soon()

        for widget in widgets:
            widget.param.watch(changed, of)
