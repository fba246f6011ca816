"""Progress of long work: a callback, its parts for the steps of the work, and a message while kernels compile."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

Progress = Callable[[str, float], None]
"""A callback that gets the name of the present step, and the share of the work that is done, 0 … 1."""


def silent(step: str, share: float) -> None:
    """Ignore progress."""


def part(progress: Progress, start: float, end: float, title: str = "") -> Progress:
    """Return the callback of a part of the work, from share `start` to `end`. title: comes before the step's name."""

    def within(step: str, share: float) -> None:
        progress(f"{title}: {step}" if title else step, start + share * (end - start))

    return within


def of_tasks(progress: Progress, step: str, count: int) -> list[Callable[[float], None]]:
    """Return a callback for each of `count` tasks that run side by side, which gets the share of it that is done."""
    shares = [0.0] * count

    def report(task: int, share: float) -> None:
        shares[task] = share
        progress(step, sum(shares) / count)

    return [partial(report, task) for task in range(count)]


@contextmanager
def with_compilation(progress: Progress) -> Iterator[Progress]:
    """Yield a callback that passes progress on, and reports when numba compiles a kernel, once after installation."""
    from numba.core import event

    last = ("", 0.0)

    def remembered(step: str, share: float) -> None:
        nonlocal last
        last = (step, share)
        progress(step, share)

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            progress("compiling numerical kernels, once after installation: about a minute", last[1])

        def on_end(self, event: Any) -> None:
            progress(*last)

    with event.install_listener("numba:compile", Listener()):
        yield remembered
