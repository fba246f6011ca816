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
    finally:  # all is done; a signal while Python shuts down would print a traceback
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _stop(number: int, frame: FrameType | None) -> None:
    """End this process by the signal that it got, so that a shell sees it; threads are not waited for."""
    end_all()
    if sys.stderr is not None:
        clear = "\r\x1b[2K\x1b[?25h" if sys.stderr.isatty() else ""  # delete a progress bar, and show the cursor again
        os.write(sys.stderr.fileno(), f"{clear}lutforge: stopped\n".encode())
    signal.signal(number, signal.SIG_DFL)
    discard_unfinished()  # as the last step: threads still run, and could make a temporary file again
    signal.raise_signal(number)
