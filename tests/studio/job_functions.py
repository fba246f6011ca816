"""What the tests of jobs run in another process, apart from the tests so that it loads at once."""

import os
import time
from collections.abc import Callable
from pathlib import Path

from lutforge.atomic_write import scratch_folder
from lutforge.errors import SampleError


def doubled(value: int, progress: Callable[[str, float], None]) -> int:
    progress("doubling", 0.5)
    return 2 * value


def wrong(progress: Callable[[str, float], None]) -> None:
    raise SampleError("two\nlines")


def broken(progress: Callable[[str, float], None]) -> None:
    raise ZeroDivisionError("never")


def killed(progress: Callable[[str, float], None]) -> None:
    os._exit(9)


def endless(path: Path, progress: Callable[[str, float], None]) -> None:
    while True:
        path.write_text(str(os.getpid()))
        time.sleep(0.02)


def writes_for_ever(path: Path, progress: Callable[[str, float], None]) -> None:
    with scratch_folder(path) as folder:
        (folder / "begun").touch()
        while True:
            time.sleep(0.02)
