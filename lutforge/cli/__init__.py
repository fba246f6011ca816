"""The `lutforge` command."""

import os
import signal
import sys
from types import FrameType

from lutforge.atomic_write import discard_unfinished
from lutforge.child_processes import end_all


def start() -> None:
    """Load the command line and run it; Ctrl-C and SIGTERM end it with one line, and leave nothing half-written."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _stop)
    from lutforge.cli.main import main

    try:
        main()
    finally:  # all is done, and Python's own end would else die by a signal
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _stop(number: int, frame: FrameType | None) -> None:
    """End this process by the signal that it got, so that a shell knows; threads are not waited for."""
    end_all()
    if sys.stderr is not None:
        clear = "\r\x1b[2K\x1b[?25h" if sys.stderr.isatty() else ""  # a bar hides the cursor
        os.write(sys.stderr.fileno(), f"{clear}lutforge: stopped\n".encode())
    signal.signal(number, signal.SIG_DFL)
    discard_unfinished()  # last of all: a thread that is still at work would make its file anew
    signal.raise_signal(number)
