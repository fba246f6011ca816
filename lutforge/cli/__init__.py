"""The `lutforge` command."""

import sys


def start() -> None:
    """Load the command line and run it; Ctrl-C meanwhile ends it with one line, too."""
    try:
        from lutforge.cli.main import main

        main()
    except KeyboardInterrupt:
        print("lutforge: stopped", file=sys.stderr)
        sys.exit(130)
