"""Work in other processes, one piece after the other, with what is short beside what is long."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lutforge.errors import LutForgeError, one_line
from lutforge.studio.jobs import Job, JobReport


@dataclass(eq=False)
class Work:
    """A piece of work that a job does in another process.

    job: None while the work waits for its turn; call: returns the job's function and arguments, and is called when the
    turn has come, so that it can build on the results of the work before it. short: it runs beside what is long;
    message: what was last reported.
    """

    title: str
    done: Callable[[Any], None]
    call: Callable[[], tuple[Any, ...]]
    short: bool
    job: Job | None = None
    message: str = "starting"


class JobQueue:
    """The works of a session in the order of their turns: the first long one is under way, and the short one."""

    def __init__(self) -> None:
        self.works: list[Work] = []

    @property
    def is_busy(self) -> bool:
        """Whether short work is under way."""
        return any(work.short for work in self.works)

    def add(self, work: Work) -> Work | None:
        """Add work; short work replaces the last such work. Returns the work before it, if there is any to wait for."""
        before = [queued for queued in self.works if queued.short == work.short]
        if work.short:
            self.end(before)
        self.works.append(work)
        return before[-1] if before and not work.short else None

    def reports(self) -> list[tuple[Work, JobReport]]:
        """Begin the works whose turn it is, and return where they stand; those that have ended leave the queue."""
        heard = []
        for short in (False, True):
            work = next((work for work in self.works if work.short == short), None)
            if work is None:
                continue
            try:
                work.job = work.job or Job(*work.call())
                report = work.job.report
            except LutForgeError as error:  # what it needs is no longer there
                report = JobReport("failed", one_line(str(error)))
            if report.state != "running":
                self.end([work])
            heard.append((work, report))
        return heard

    def end(self, works: list[Work]) -> None:
        """End works, whether they wait, are under way or are done."""
        self.works = [work for work in self.works if work not in works]
        for work in works:
            if work.job is not None:
                work.job.cancel()

    def cancel(self) -> list[Work]:
        """End what is long, with what waits for it, or else what is short. Returns what was ended."""
        long = any(not work.short for work in self.works)
        ended = [work for work in self.works if work.short != long]
        self.end(ended)
        return ended
