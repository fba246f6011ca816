"""Progress of long work: a callback, its parts for the steps of the work, and a message while kernels compile."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""


def silent(what: str, share: float) -> None:
    """Take the progress of work that nobody watches, and do nothing."""


def part(progress: Progress, start: float, end: float, title: str = "") -> Progress:
    """Return the callback of a step that takes the work from share `start` to `end`. title: precedes its messages."""

    def within(what: str, share: float) -> None:
        progress(f"{title}: {what}" if title else what, start + share * (end - start))

    return within


@contextmanager
def telling_of_compilation(progress: Progress) -> Iterator[Progress]:
    """Yield a callback that passes progress on and says when numba compiles a kernel, once after an installation."""
    from numba.core import event

    last = ("", 0.0)

    def remembered(what: str, share: float) -> None:
        nonlocal last
        last = (what, share)
        progress(what, share)

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            progress("compiling numerical kernels, once after installation: about a minute", last[1])

        def on_end(self, event: Any) -> None:
            progress(*last)

    with event.install_listener("numba:compile", Listener()):
        yield remembered
