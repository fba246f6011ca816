"""Progress is drawn on the terminal, and what a command prints goes where its output goes."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cases.pictures import write_cube

pytestmark = pytest.mark.skipif(os.name != "posix", reason="opens a terminal")


def test_a_bar_on_the_terminal_takes_nothing_from_a_pipe(tmp_path: Path) -> None:
    ours, theirs = os.openpty()
    lut = write_cube(tmp_path / "look.cube")
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), "TERM": "xterm", "COLUMNS": "120"}
    words = [sys.executable, "-m", "lutforge", "check", str(lut)]
    shown = b""
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=theirs, env=environment, text=True) as run:
        os.close(theirs)
        # A terminal that is read from to its end: on Linux that is an error, on macOS no bytes.
        with contextlib.suppress(OSError):
            while part := os.read(ours, 1 << 16):
                shown += part
        os.close(ours)
        said, _ = run.communicate(timeout=60)
    assert b"checking" in shown
    assert b"look.cube" in shown
    assert "9³ nodes" in said
    assert "9³ nodes".encode() not in shown
    assert "\x1b" not in said
