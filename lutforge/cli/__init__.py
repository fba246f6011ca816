"""The `lutforge` command."""

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress


def start() -> None:
    """Load the command line and run it; Ctrl-C meanwhile ends it with one line, too.

    The process ends before Python takes its modules apart, which takes half a second after a fit: Python calls the exit
    handlers in the reverse of their order, so the one that is registered here, before all others, is the last.
    """
    status = 1  # of an error that nothing foresaw, whose traceback Python prints

    def end() -> None:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):  # a pipe without a reader
                stream.flush()
        os._exit(status)

    atexit.register(end)
    gc.set_threshold(50_000)  # almost all that loading makes stays: it need not be looked through every 700 objects
    try:
        from lutforge.cli.main import main

        main()
    except SystemExit as left:
        status = left.code if isinstance(left.code, int) else int(left.code is not None)
    except KeyboardInterrupt:
        print("lutforge: stopped", file=sys.stderr)
        status = 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own end would else die by the signal
