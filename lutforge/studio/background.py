"""Work in other processes as a page shows it: started, reported, cancelled, and its results taken over."""

import asyncio
from collections.abc import Callable
from contextvars import Context
from typing import Any

import panel as pn
from tornado.ioloop import PeriodicCallback

from lutforge.progress import silent
from lutforge.studio.job_queue import JobQueue, Work
from lutforge.studio.page_link import PageLink

PERIOD_MS = 120
"""Milliseconds between two looks at where jobs stand."""


class Background:
    """The work of a session, which goes on while no page shows it."""

    def __init__(self) -> None:
        self.queue = JobQueue()
        self._polling: Any = None

    def attach(self, page: PageLink) -> None:
        """Report to a page from now on."""
        self._stop_polling()  # which would go on as the page before had asked for it
        self._report_to(page)
        if self.queue.works:
            self._wait()

    def detach(self, page: PageLink) -> None:
        """Report to a link that no page has, and end short work, whose results only a page uses."""
        self._stop_polling()
        self._report_to(page)
        self.queue.end([work for work in self.queue.works if work.short])
        if self.queue.works and _is_served():
            self._polling = PeriodicCallback(self.poll, PERIOD_MS)
            Context().run(self._polling.start)  # not as the page that is closed, which may be the present one still

    def _report_to(self, page: PageLink) -> None:
        self.page = page
        self.cancel_button = page.button("Cancel", self.cancel, visible=False)

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
        self.start_in_turn(title, done, lambda: (function, *arguments), short)

    def start_in_turn(
        self, title: str, done: Callable[[Any], None], call: Callable[[], tuple[Any, ...]], short: bool = False
    ) -> None:
        """Start work whose function and arguments `call` returns when its turn has come."""
        if pn.state.curdoc is None and not _is_served():
            function, *arguments = call()
            done(function(*arguments, silent))
            return
        self.page.forget_errors(title)
        before = self.queue.add(Work(title, done, call, short))
        self.page.say(f"{title} …" if before is None else f"{title}: comes after {before.title}")
        self._wait()
        self.poll()

    def _wait(self) -> None:
        """Ask for the reports of jobs until there is no work, under the lock of the page."""
        self.page.status.progress.visible = self.cancel_button.visible = True
        if self._polling is None and pn.state.curdoc is not None:
            self._polling = pn.state.add_periodic_callback(self.page.guarded(self.poll), period=PERIOD_MS)

    def _stop_polling(self) -> None:
        if self._polling is not None:
            self._polling.stop()
            self._polling = None

    @property
    def is_busy(self) -> bool:
        """Whether short work is under way."""
        return self.queue.is_busy

    def poll(self) -> None:
        """Begin the work whose turn it is, and take over what the jobs have reported."""
        if not pn.state.loaded:
            return  # Panel loses what changes while a page loads
        for work, report in self.queue.reports():
            if report.state == "running":
                self.page.status.show_share(report.share)
                if report.message != work.message:  # other news stay until there are new ones
                    work.message = report.message
                    self.page.say(f"{work.title}: {report.message}")
            elif report.state == "done":
                self.page.attempt(work.done, report.result)
            else:
                self.page.say(f"{work.title}: {report.message}", wrong=True, job=work.title)
        self._rest()

    def _rest(self) -> None:
        """Hide what shows work, where there is none."""
        busy = bool(self.queue.works)
        self.page.status.progress.visible = self.cancel_button.visible = busy
        if not busy:
            self._stop_polling()

    def cancel(self) -> None:
        """End what is under way, and what waits for it."""
        ended = self.queue.cancel()
        self._rest()
        if ended:
            self.page.say(f"{', '.join(work.title for work in ended)}: cancelled")


def _is_served() -> bool:
    """Whether a server runs in this thread, which goes on when a page is closed."""
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True
