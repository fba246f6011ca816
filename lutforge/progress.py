"""How long work tells where it is: one callback, cut into parts, that also says when kernels compile."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

Progress = Callable[[str, float], None]
"""Called with what is being done and the share that is done, 0 … 1."""


def silent(what: str, share: float) -> None:
    """The progress of work that nobody watches."""


def part(progress: Progress, start: float, end: float, title: str = "") -> Progress:
    """The progress of a step that takes the shares from `start` to `end`. title: stands before its words."""

    def within(what: str, share: float) -> None:
        progress(f"{title}: {what}" if title else what, start + share * (end - start))

    return within


@contextmanager
def telling_of_compilation(progress: Progress) -> Iterator[Progress]:
    """A progress that says, too, when numba compiles a kernel: it does so once after an installation, in silence."""
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
