"""Progress: the stage of the work and the compilation of kernels, drawn on the terminal, apart from the output."""

import contextlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest

from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.srgb import srgb_encode
from lutforge.progress import part, with_compilation
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_cube


def test_a_part_takes_its_share_of_the_whole() -> None:
    told: list[tuple[str, float]] = []
    within = part(lambda what, share: told.append((what, share)), 0.5, 1.0, "vivid")
    within("fitting", 0.5)
    assert told == [("vivid: fitting", 0.75)]


def test_compiling_a_kernel_is_told_once() -> None:
    told: list[tuple[str, float]] = []

    doubled: Any = numba.njit(lambda value: 2 * value)

    with with_compilation(lambda what, share: told.append((what, share))) as progress:
        progress("fitting", 0.25)
        doubled(1.0)
        doubled(2.0)
    assert [what for what, _ in told] == ["fitting", told[1][0], "fitting"]
    assert "compiling" in told[1][0]
    assert {share for _, share in told} == {0.25}


def test_a_calibration_tells_of_each_step_before_it_begins() -> None:
    told: list[str] = []
    raw = np.random.default_rng(0).uniform(0.01, 0.9, (120, 3))
    samples = SampleSet.from_arrays(raw, srgb_encode(raw), camera="camera", shot=np.arange(120) % 3)
    calibrate(samples, CalibrationOptions(size=5), lambda what, share: told.append(what))
    assert told[0] == "checking white balances and shots" and told[1].startswith("fitting ")


@pytest.mark.skipif(os.name != "posix", reason="opens a terminal")
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
        message, _ = run.communicate(timeout=60)
    assert b"checking" in shown
    assert b"look.cube" in shown
    assert "9³ nodes" in message
    assert "9³ nodes".encode() not in shown
    assert "\x1b" not in message
