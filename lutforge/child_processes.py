"""Run programs, and functions that read untrusted files, in processes that end when Ctrl-C ends the command."""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from threading import Lock, RLock, Timer
from typing import Any, ParamSpec, TypeVar

from lutforge.errors import LutForgeError, ShotError, one_line

P = ParamSpec("P")
R = TypeVar("R")

MOST_SECONDS = 600
"""Seconds after which a program is ended; some programs wait forever for a display that does not exist."""
SECONDS = 10
"""Most seconds of processor time of a guarded call; the largest LUTs and configs that OpenColorIO reads take three."""
WAIT = 6 * SECONDS
"""Seconds after which a guarded call is ended, however little processor time it got."""
MEMORY = 4 << 30
"""Most bytes of address space of the process of guarded calls."""

_running: set["subprocess.Popen[Any]"] = set()
_beginning = RLock()  # reentrant: a signal handler may acquire it in the thread that holds it
_guarding = Lock()
_guard: "subprocess.Popen[bytes] | None" = None


def run(
    command: Sequence[str], timeout: float, environment: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a program to its end, without input, and return its status and what it wrote.

    timeout: seconds; it and its own children are then ended, and subprocess.TimeoutExpired is raised. Raises OSError
    where the program cannot be run.
    """
    with _beginning:
        process = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment,
            text=True, errors="replace", process_group=0 if os.name == "posix" else None,
        )  # fmt: skip
        _running.add(process)
    try:
        output, errors = process.communicate(timeout=timeout)
    except BaseException:
        _end(process)
        process.communicate()
        raise
    finally:
        _running.discard(process)
    return subprocess.CompletedProcess(command, process.returncode, output, errors)


def run_command(command: Sequence[str], name: str, source: Path, output: Path) -> str:
    """Run a command that makes the file `output` from `source`; return what it wrote to standard error.

    name: of the program, for people. Raises ShotError, with the line in which the program gives the reason, where there
    is no output.
    """
    # Without a display variable no program waits for a window.
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    try:
        finished = run(command, MOST_SECONDS, environment)
    except subprocess.TimeoutExpired:
        raise ShotError(f"{source}: {name} did not finish within {MOST_SECONDS // 60} minutes") from None
    except OSError as error:
        raise ShotError(f"{command[0]} cannot be run ({error.strerror or error})") from None
    if not output.is_file() or output.stat().st_size == 0:
        lines = [line for line in (finished.stderr or finished.stdout).splitlines() if line.strip()]
        errors = [line for line in lines if re.search("fail|error|cannot|unsupported|mismatch", line, re.IGNORECASE)]
        reason = one_line((errors or lines[-1:] or ["it gave no reason"])[0].removeprefix(f"{source}: "), 200)
        raise ShotError(f"{source}: {name} made no picture of it: {reason}")
    return finished.stderr


def end_all() -> None:
    """End the running programs and their children. Afterwards none can be begun: this process is about to end."""
    _beginning.acquire()
    for process in tuple(_running):
        _end(process)
        with suppress(subprocess.TimeoutExpired):  # the system may take a moment to end it
            process.wait(1.0)


def _end(process: "subprocess.Popen[Any]") -> None:
    if process.poll() is None:
        if os.name == "posix":
            os.killpg(process.pid, signal.SIGKILL)
        else:
            process.kill()


class OverrunError(LutForgeError):
    """A guarded call that exceeded its limits, or ended the process that it ran in."""


def guarded(function: Callable[P, R], *arguments: P.args, **words: P.kwargs) -> R:
    """Call a module's function in another process, within limits of time and memory, and return its value.

    Native parsers may loop while they hold Python's lock, so that neither Ctrl-C nor a timer of this process can stop
    them, or allocate all memory. Another process can be ended; it is kept for the next call. The function, its
    arguments and its value are pickled. Raises what the function raises; OverrunError where it takes more than SECONDS
    or MEMORY, or ends the process. Ctrl-C ends the call.
    """
    import pickle  # imported here: most commands guard nothing

    with _guarding:
        process = _guard_process()
        timer, question, answer = Timer(WAIT, process.kill), process.stdin, process.stdout
        try:
            timer.start()
            pickle.dump((str(Path.cwd()), function, arguments, words), question)
            question.flush()
            value, error = pickle.load(answer)
        except BaseException as failure:
            _end(process)
            for channel in (question, answer):
                with suppress(OSError):
                    channel.close()
            process.wait()
            if isinstance(failure, EOFError | OSError | pickle.UnpicklingError):
                limits = f"{SECONDS} seconds or {MEMORY >> 30} GB"
                raise OverrunError(f"it takes more than {limits} to read, or ends its reader") from None
            raise
        finally:
            timer.cancel()
    if error is not None:
        raise error
    return value  # type: ignore[no-any-return]  # pickled


def _guard_process() -> Any:  # a process with its channels
    global _guard
    if _guard is None or _guard.poll() is not None:
        paths = [str(Path(entry).absolute()) for entry in sys.path]
        with _beginning:
            _guard = subprocess.Popen(
                [sys.executable, "-c", "from lutforge.child_processes import serve; serve()"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(paths)},
                process_group=0 if os.name == "posix" else None,
            )  # fmt: skip
            _running.add(_guard)
    return _guard


def serve() -> None:
    """Answer guarded calls until the calling process has ended."""
    import pickle  # imported here: most commands guard nothing

    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # so that text which a library prints does not mix with the answers
    with suppress(ImportError, OSError, ValueError):  # Windows has no such limits; WAIT remains
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    while True:
        try:
            folder, function, arguments, words = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        with suppress(ImportError, OSError, ValueError):  # the system ends this process after SECONDS more
            import resource

            used = resource.getrusage(resource.RUSAGE_SELF)
            soft = int(used.ru_utime + used.ru_stime) + SECONDS + 1
            resource.setrlimit(resource.RLIMIT_CPU, (soft, resource.getrlimit(resource.RLIMIT_CPU)[1]))
        value: Any = None
        failure: LutForgeError | None = None
        try:
            os.chdir(folder)
            value = function(*arguments, **words)
        except LutForgeError as error:
            failure = error
        except Exception as error:
            failure = LutForgeError(f"{type(error).__name__}: {error}")
        pickle.dump((value, failure), answers)
        answers.flush()
