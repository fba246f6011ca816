"""Calls in a process of their own: their values and errors return, and they end at their limits and on Ctrl-C."""

import os
import signal
import threading

import pytest

from lutforge.child_processes import OverrunError, guarded
from lutforge.errors import LutForgeError

ENDLESS = range(10**15)
"""Its sum is a loop in C that holds Python's lock."""


def test_values_and_errors_come_back() -> None:
    assert guarded(divmod, 7, 2) == (3, 1)
    with pytest.raises(LutForgeError, match="ZeroDivisionError"):
        guarded(divmod, 7, 0)


def test_a_crash_is_an_error_and_the_next_call_has_a_process() -> None:
    with pytest.raises(OverrunError, match="it takes more than"):
        guarded(os.abort)
    assert guarded(abs, -1) == 1


@pytest.mark.slow
def test_an_endless_call_is_ended() -> None:
    with pytest.raises(OverrunError, match="10 seconds"):
        guarded(sum, ENDLESS)


@pytest.mark.skipif(os.name != "posix", reason="other systems send no such signal to one process")
def test_ctrl_c_ends_an_endless_call() -> None:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # jobs in the background ignore it
    try:
        threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
        with pytest.raises(KeyboardInterrupt):
            guarded(sum, ENDLESS)
    finally:
        signal.signal(signal.SIGINT, before)
    assert guarded(abs, -1) == 1
