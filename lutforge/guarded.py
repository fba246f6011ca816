"""Run a function on a stranger's file in a process of its own, within limits of time and memory.

Native parsers may loop with Python's lock held, so that neither Ctrl-C nor a timer of this process is heard, or ask for
all memory. What they do in another process can be ended. That process is kept for the next file.
"""

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from threading import Lock, Timer
from typing import IO, Any, ParamSpec, TypeVar

from lutforge.child_processes import keep
from lutforge.errors import LutForgeError

P = ParamSpec("P")
R = TypeVar("R")

SECONDS = 10
"""Processor time of a call; the largest LUTs and configs that OpenColorIO reads take three."""
WAIT = 6 * SECONDS
"""Seconds until a call is given up, however little of the processor it had."""
MEMORY = 4 << 30
"""Bytes of address space of the process."""

_lock = Lock()
_process: "subprocess.Popen[bytes] | None" = None


class OverrunError(LutForgeError):
    """A call that did not end within its limits, or ended the process that it ran in."""


def guarded(function: Callable[P, R], *arguments: P.args, **words: P.kwargs) -> R:
    """Return what a module's function returns, called in the other process.

    The function, its arguments and its value are pickled. What it raises is raised here; OverrunError where it takes
    more than SECONDS or MEMORY, or ends the process. Ctrl-C ends the call.
    """
    with _lock:
        process = _started()
        timer = Timer(WAIT, process.kill)
        try:
            timer.start()
            channel_in, channel_out = _channels(process)
            pickle.dump((str(Path.cwd()), function, arguments, words), channel_in)
            channel_in.flush()
            value, error = pickle.load(channel_out)
        except (EOFError, OSError, pickle.UnpicklingError):
            _end(process)
            limits = f"{SECONDS} seconds or {MEMORY >> 30} GB"
            raise OverrunError(f"it takes more than {limits} to read, or ends its reader") from None
        except BaseException:
            _end(process)
            raise
        finally:
            timer.cancel()
    if error is not None:
        raise error
    return value  # type: ignore[no-any-return]  # pickled


def prepare(module: str) -> None:
    """Begin the other process: it loads the module of a function to come while this one does other things."""
    with _lock:
        _started(module)


def _started(module: str = __name__) -> "subprocess.Popen[bytes]":
    global _process
    if _process is None or _process.poll() is not None:
        paths = [str(Path(entry).absolute()) for entry in sys.path]
        command = [sys.executable, "-c", f"from lutforge.guarded import serve; serve({module!r})"]
        _process = keep(command, {**os.environ, "PYTHONPATH": os.pathsep.join(paths)})
    return _process


def _channels(process: "subprocess.Popen[bytes]") -> tuple[IO[bytes], IO[bytes]]:
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout


def _end(process: "subprocess.Popen[bytes]") -> None:
    process.kill()
    for channel in _channels(process):
        with suppress(OSError):
            channel.close()
    process.wait()


def serve(module: str) -> None:
    """Load a module, and answer calls until the process that asks is gone."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    _limit_memory()
    import_module(module)
    while True:
        try:
            folder, function, arguments, words = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        _limit_time()
        answer: tuple[Any, BaseException | None]
        try:
            os.chdir(folder)
            answer = function(*arguments, **words), None
        except Exception as error:
            answer = (
                None,
                error if isinstance(error, LutForgeError) else LutForgeError(f"{type(error).__name__}: {error}"),
            )
        pickle.dump(answer, answers)
        answers.flush()


def _limit_memory() -> None:
    with suppress(ImportError, OSError, ValueError):  # Windows has no such limits; WAIT remains
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _limit_time() -> None:
    """Let the system end this process when it has used SECONDS more of the processor."""
    with suppress(ImportError, OSError, ValueError):
        import resource

        used = resource.getrusage(resource.RUSAGE_SELF)
        soft = int(used.ru_utime + used.ru_stime) + SECONDS + 1
        resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.getrlimit(resource.RLIMIT_CPU)[1]))
