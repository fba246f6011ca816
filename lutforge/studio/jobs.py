"""Long work in a process of its own: the page stays quick, and cancelling really ends the work.

Processes, not threads: a fit holds Python's lock and numba's threads, and a thread cannot be stopped.
"""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from multiprocessing.connection import Connection
from types import FrameType
from typing import Any, Literal

from lutforge.atomic_write import discard_unfinished
from lutforge.errors import LutForgeError, one_line

PATIENCE_S = 2.0
"""Seconds for a cancelled job to remove what it had begun to write; compiled code hears no signal meanwhile."""


@cache
def _context() -> Any:
    """The way to start processes: from a server that has loaded the fits already, where the system can fork."""
    context: Any = multiprocessing.get_context("forkserver" if os.name == "posix" else "spawn")
    if os.name == "posix":
        context.set_forkserver_preload(["lutforge.studio.opening", "numba"])  # numba takes a second of each fit else
    return context


@dataclass(frozen=True)
class JobReport:
    """Where a job stands. share: 0 … 1; message: the step, or one line of what went wrong."""

    state: Literal["running", "done", "failed"]
    message: str = ""
    share: float = 0.0
    result: Any = None


class Job:
    """`function(*arguments, progress)` in a child process. report: where it stands, kept up to date by a thread.

    The function, its arguments and its result are pickled, between processes of this program only.
    """

    def __init__(self, function: Callable[..., Any], *arguments: Any) -> None:
        self.report = JobReport("running", "starting")
        news, send = _context().Pipe(duplex=False)
        self._process = _context().Process(target=_work, args=(send, function, arguments), daemon=True)
        self._started = threading.Event()
        self._follower = threading.Thread(target=self._follow, args=(news, send), daemon=True)
        self._follower.start()

    def _follow(self, news: Connection, send: Connection) -> None:
        """Start the process, and take over its reports, so that it never waits for someone who reads them."""
        try:
            with send:
                self._process.start()  # which takes seconds where no process can fork
            self._started.set()
            while self.report.state == "running":
                self.report = news.recv()
        except (EOFError, OSError):
            self.report = JobReport("failed", "the calculation ended without a result, perhaps out of memory")
        except Exception as error:  # of arguments or a result that cannot be pickled
            self.report = JobReport("failed", f"{type(error).__name__}: {one_line(str(error), 300)}")
        finally:
            self._started.set()
            news.close()

    def wait(self, seconds: float) -> JobReport:
        """Return the report of the job when it ends, or its present report after some seconds."""
        self._follower.join(seconds)
        return self.report

    def cancel(self) -> None:
        """End the process; its result, if there is one on the way, is dropped."""
        self._started.wait()
        if self._process.pid is not None:  # it could be started
            self._process.terminate()
            self._process.join(PATIENCE_S)
            self._process.kill()
            self._process.join()


def _work(send: Connection, function: Callable[..., Any], arguments: tuple[Any, ...]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl+C is for the studio, which ends its jobs
    for number in {signal.SIGTERM, getattr(signal, "SIGHUP", signal.SIGTERM)}:  # cancelled, or its terminal is closed
        signal.signal(number, _stop)
    threading.Thread(target=_end_with_the_studio, daemon=True).start()

    def progress(step: str, share: float) -> None:
        send.send(JobReport("running", step, share))

    try:
        report = JobReport("done", "done", 1.0, function(*arguments, progress))
    except LutForgeError as error:
        report = JobReport("failed", one_line(str(error)))
    except MemoryError:
        report = JobReport("failed", "not enough memory: give fewer samples, or a smaller lattice")
    except Exception as error:  # whatever fails is told in the page, and the server goes on
        report = JobReport("failed", f"{type(error).__name__}: {one_line(str(error), 300)}")
    with suppress(OSError):  # the studio has ended
        send.send(report)


def _end_with_the_studio() -> None:
    """End this process, without what it had begun to write, when the studio has ended, however that came."""
    studio = multiprocessing.parent_process()
    if studio is not None:
        studio.join()
        discard_unfinished()
        os._exit(1)


def _stop(number: int, frame: FrameType | None) -> None:
    """End this process, a job that was cancelled, without what it had begun to write."""
    discard_unfinished()
    signal.signal(number, signal.SIG_DFL)
    signal.raise_signal(number)


def warm_up() -> None:
    """Start the server of processes ahead of the first job, so that Ctrl+C reaches the studio alone."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)  # children inherit it
    try:
        if _context().get_start_method() == "forkserver":
            from multiprocessing.forkserver import ensure_running

            ensure_running()
    finally:
        signal.signal(signal.SIGINT, before)
    Job(bool)  # any function will do
