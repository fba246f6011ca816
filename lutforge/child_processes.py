"""Run other programs so that none outlives a command that Ctrl-C ends."""

import os
import signal
import subprocess
from collections.abc import Mapping, Sequence
from contextlib import suppress
from threading import RLock
from typing import Any

_running: set["subprocess.Popen[Any]"] = set()
_beginning = RLock()  # a signal may come while this thread holds it


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
        said, complained = process.communicate(timeout=timeout)
    except BaseException:
        _end(process)
        process.communicate()
        raise
    finally:
        _running.discard(process)
    return subprocess.CompletedProcess(command, process.returncode, said, complained)


def keep(command: Sequence[str], environment: Mapping[str, str]) -> "subprocess.Popen[bytes]":
    """Begin a program that answers on its output what it is asked on its input, until the input ends."""
    with _beginning:
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, env=environment,
            process_group=0 if os.name == "posix" else None,
        )  # fmt: skip
        _running.add(process)
    return process


def end_all() -> None:
    """End the programs that run, and their own children. None can be begun afterwards: this process is about to end."""
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
