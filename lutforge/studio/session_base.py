"""What a page says to its visitor, what it hears from widgets, and its work in other processes."""

import logging
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import wraps
from html import escape
from typing import Any

import panel as pn
import panel_material_ui as pmui

from lutforge.errors import LutForgeError
from lutforge.studio.elements import text
from lutforge.studio.jobs import Job
from lutforge.studio.workspace import WorkspaceError


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


class SessionBase:
    """What a session does for its pages: the line of news, guarded callbacks, and jobs with their progress."""

    def __init__(self) -> None:
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
