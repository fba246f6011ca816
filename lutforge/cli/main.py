"""The command line; errors are one line on stderr and exit status 2."""

import io
import os
import sys
from importlib import import_module
from typing import Any

import typer

from lutforge import __version__
from lutforge.cli.console import complain
from lutforge.errors import LutForgeError

PURPOSE = "Calibrate a camera from its RAW and JPEG files, and bake its rendering into LUTs and OpenColorIO configs."

COMMANDS = {
    "demo": "demo",
    "inspect": "inspection",
    "sample": "sampling",
    "calibrate": "calibration",
    "response": "response",
    "evaluate": "reports",
    "bake": "bake",
    "kit": "kit",
    "config": "config",
    "apply": "apply",
    "transfer": "calibration",
    "check": "inspection",
    "report": "reports",
    "compare": "reports",
    "studio": "studio",
    "import-nus": "published_models",
    "export-nus": "published_models",
}
"""The commands in the order of the help, and the module of `lutforge.cli` that defines each."""

UsageErrors: Any = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "ClickException")
"""The root of typer's errors of usage, which typer itself does not name."""


def command_line(first: str = "") -> typer.Typer:
    """The command line. first: the first word; where it names a command, only that command's module is imported."""
    app = typer.Typer(
        name="lutforge",
        help=PURPOSE,
        invoke_without_command=True,
        pretty_exceptions_enable=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )

    @app.callback()
    def root(
        context: typer.Context, version: bool = typer.Option(False, "--version", help="Print the version.")
    ) -> None:
        if version:
            print(f"lutforge {__version__}")
            raise typer.Exit
        if context.invoked_subcommand is None:
            print(context.get_help())

    for name in (first,) if first in COMMANDS else COMMANDS:
        module = import_module(f"lutforge.cli.{COMMANDS[name]}")
        app.command(name)(getattr(module, name.replace("-", "_")))
    return app


def main() -> None:
    """Run the command line and exit: 0 done, 1 some images of a batch failed, 2 bad input or usage."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:  # closed, as under some daemons: the next opened file would get its number
            opened = os.open(os.devnull, os.O_RDONLY if name == "stdin" else os.O_WRONLY)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
            setattr(sys, name, os.fdopen(number, "r" if name == "stdin" else "w", encoding="utf-8"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")  # a terminal without "→" and "Δ" shows "?"
    if "" in sys.argv[1:]:  # as a path it would mean this folder
        _stop("an empty word: is a variable of the shell not set?", 2)
    try:
        status = command_line(*sys.argv[1:2])(standalone_mode=False)
        sys.stdout.flush()  # raises an error where the disk is full
    except LutForgeError as error:
        _stop(str(error), 2)
    except UsageErrors as error:
        context = getattr(error, "ctx", None)
        hint = f" (see `{context.command_path} --help`)" if context is not None else ""
        _stop(error.format_message() + hint, 2)
    except (KeyboardInterrupt, typer.Abort):
        _stop("stopped", 130)
    except BrokenPipeError:  # the reader of a pipe, such as head, has ended
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(0)
    except MemoryError:
        _stop("not enough memory: give fewer or smaller files at a time", 2)
    except OSError as error:
        _stop(f"{error.filename or 'file system'}: {error.strerror or error}", 2)
    except RuntimeError as error:
        if not str(error).startswith("Symlink loop"):  # Python's error before 3.13 for a link that leads to itself
            raise
        _stop(f"{error}: name the file that it should lead to", 2)
    sys.exit(status if isinstance(status, int) else 0)


def _stop(message: str, status: int) -> None:
    """Print an error and exit."""
    complain(" ".join(message.split()))
    sys.exit(status)
