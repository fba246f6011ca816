"""Ctrl-C at any moment: one line, within a second, and nothing half-written."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lutforge.apply.journal import NAME
from lutforge.images.read import read_image
from tests.apply.graded_images import write_cube, write_picture

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")


def interrupted(folder: Path, seconds: float, *words: str) -> tuple[int, str, float]:
    """Exit status, stderr, and how long the command took to end once it was interrupted after so many seconds."""
    run = subprocess.Popen(
        [sys.executable, "-m", "lutforge", *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        text=True, env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
    )  # fmt: skip
    time.sleep(seconds)
    began = time.monotonic()
    run.send_signal(signal.SIGINT)
    _, said = run.communicate(timeout=60)
    return run.returncode, said, time.monotonic() - began


@pytest.mark.slow
@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_grading_stops_at_once_and_leaves_whole_files(tmp_path: Path, suffix: str) -> None:
    write_cube(tmp_path / "look.cube")
    write_picture(tmp_path / f"a{suffix}", (1500, 2000))
    for number in range(40):
        (tmp_path / f"b{number}{suffix}").hardlink_to(tmp_path / f"a{suffix}")
    pictures = [f"b{number}{suffix}" for number in range(40)]
    ends = []
    for seconds in (0.8, 1.3, 2.0, 3.0):
        status, said, took = interrupted(tmp_path, seconds, "apply", "look.cube", *pictures, "-o", "out")
        if status == 0:
            continue
        assert (status, said) == (130, "lutforge: stopped\n")
        ends.append(took)
        for path in (tmp_path / "out").glob("*"):
            assert path.name == NAME or read_image(path).pixels.shape == (1500, 2000, 3)
    assert min(ends) < 1.0
    assert not list(tmp_path.glob("out/.*.lutforge-*"))


def test_a_long_fit_stops_at_once(tmp_path: Path) -> None:
    """The demo photographs, calibrates and bakes: whatever it is at after some seconds."""
    status, said, took = interrupted(tmp_path, 3.0, "demo", "-o", "demo")
    assert (status, said.splitlines()[-1]) == (130, "lutforge: stopped")
    assert took < 5.0  # a second where nothing else runs
    assert not [path for path in tmp_path.rglob("*") if ".lutforge-" in path.name]
