"""The command that serves the studio."""

import signal
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from lutforge.boundary import require_file
from lutforge.cli.console import argument, option, say
from lutforge.errors import LutForgeError


def studio(
    sources: Annotated[
        list[Path] | None, argument("A sample table, shots or folders of them, a profile, a workspace.")
    ] = None,
    port: Annotated[int, option("The port of the page; 0 for any that is free.", min=0, max=65535)] = 5006,
    address: Annotated[str, option("Where to listen; other than 127.0.0.1 others may connect.")] = "127.0.0.1",
    folder: Annotated[
        list[Path] | None,
        option("A folder that may be read and written; may repeat. By default the inputs' and this one."),
    ] = None,
    show: Annotated[bool, option("Open the page in a browser.", "--show/--no-browser")] = True,
) -> None:
    """Look at samples, mark outliers, fit models and preview refinishing in the browser; stop it with Ctrl+C."""
    if find_spec("panel") is None:
        raise LutForgeError("the studio needs Panel: pip install 'lutforge[studio]'")
    from lutforge.studio.folders import Folders
    from lutforge.studio.server import serve

    inputs = tuple(path.resolve() for path in sources or [])
    for path in inputs:
        if not path.is_dir():
            require_file(path, "a sample table, shot, profile or workspace")
    folders = folder or [Path.cwd(), *(path if path.is_dir() else path.parent for path in inputs)]
    signal.signal(signal.SIGINT, signal.default_int_handler)  # the server ends by its KeyboardInterrupt
    serve(Folders(folders), inputs, address, port, show, lambda url: say(f"LutForge studio: {url}"))
