"""The `lutforge` command."""

import atexit
import gc
import os
import signal
import sys
from contextlib import suppress


def start() -> None:
    """Load the command line and run it; Ctrl-C meanwhile ends it with one line, too.

    The process then ends at once: Python would first take its modules apart, which takes half a second after a fit.
    """
    gc.set_threshold(50_000)  # almost all that loading makes stays: it need not be looked through every 700 objects
    status = 0
    try:
        from lutforge.cli.main import main

        main()
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else int(end.code is not None)
    except KeyboardInterrupt:
        print("lutforge: stopped", file=sys.stderr)
        status = 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own end would else die by the signal
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # a pipe without a reader
            stream.flush()
    os._exit(status)
