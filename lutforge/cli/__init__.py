"""The `lutforge` command."""

import signal
import sys


def start() -> None:
    """Load the command line and run it; Ctrl-C meanwhile ends it with one line, too."""
    try:
        from lutforge.cli.main import main

        main()
    except KeyboardInterrupt:
        print("lutforge: stopped", file=sys.stderr)
        sys.exit(130)
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # all is done: Python's own end would else die by the signal
