"""Commands start quickly: each imports what it needs and no other library."""

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
from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import PictureStyle
from lutforge.model.white_balance import WhiteBalance
from lutforge.progress import part, with_compilation
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_cube, write_picture

SLOW = {
    "numba", "scipy", "pandas", "polars", "matplotlib", "jinja2", "colour", "rawpy", "OpenImageIO",
    "PyOpenColorIO", "PIL", "simplejpeg", "panel", "bokeh", "distributed", "cv2", "numpy", "pydantic", "rich",
}  # fmt: skip
"""Libraries that take longer to load than Python itself."""


def loaded(folder: Path, *words: object) -> set[str]:
    """Which of the slow libraries a command loads, as `python -X importtime` lists them."""
    command = [sys.executable, "-X", "importtime", "-m", "lutforge", *map(str, words)]
    run = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=100)
    assert run.returncode == 0, run.stderr
    lines = [line for line in run.stderr.splitlines() if line.startswith("import time:")]
    modules = {line.rpartition("|")[2].strip().partition(".")[0] for line in lines}
    assert "lutforge" in modules
    return modules & SLOW


@pytest.mark.parametrize("words", [("--help",), ("--version",), ("apply", "--help"), ("calibrate", "--help")], ids=str)
def test_help_loads_nothing(tmp_path: Path, words: tuple[str, ...]) -> None:
    assert loaded(tmp_path, *words) <= ({"rich"} if "--help" in words else set())  # typer draws the help with it


def test_a_command_loads_those_of_its_file_alone() -> None:
    code = "import sys; from lutforge.cli.main import command_line; command_line('check'); print(*sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100)
    loaded = {name for name in run.stdout.split() if name.startswith("lutforge.cli.")}
    assert loaded == {"lutforge.cli.main", "lutforge.cli.console", "lutforge.cli.profiles"}


def test_inspecting_a_profile_loads_numpy_alone(tmp_path: Path) -> None:
    balances = {"daylight": WhiteBalance((2.0, 1.0, 1.5))}
    CameraProfile("A Camera", np.eye(3), balances, {"standard": PictureStyle()}).save(tmp_path / "camera.npz")
    assert loaded(tmp_path, "inspect", "camera.npz") == {"numpy"}


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_grading_with_a_lut_loads_what_reads_grades_and_writes(tmp_path: Path, suffix: str) -> None:
    write_cube(tmp_path / "look.cube")
    write_picture(tmp_path / f"a{suffix}")
    found = loaded(tmp_path, "apply", "look.cube", f"a{suffix}", "-o", "out")
    assert (tmp_path / "out" / f"a{suffix}").exists()
    assert found <= {"numpy", "OpenImageIO", "PyOpenColorIO", "PIL", "simplejpeg"}


@pytest.mark.slow
def test_commands_of_the_journey_load_nothing_of_reports_and_charts(tmp_path: Path, s40_samples: SampleSet) -> None:
    s40_samples.save(tmp_path / "samples.csv")
    write_picture(tmp_path / "a.jpg")
    tables = {"colour", "pandas", "polars", "matplotlib", "jinja2", "pydantic", "panel", "bokeh", "distributed", "cv2"}
    pictures = {"rawpy", "OpenImageIO", "PIL", "simplejpeg"}
    assert not loaded(tmp_path, "calibrate", "samples.csv", "--size", "5", "-o", "camera.npz") & (tables | pictures)
    for words in (
        ("inspect", "camera.npz"),
        ("bake", "camera.npz", "render", "--to", "standard/auto", "-o", "a.cube"),
        ("bake", "camera.npz", "linearize", "--from", "standard/auto", "--space", "acescg", "-o", "a.clf"),
        ("bake", "camera.npz", "refinish", "--from", "standard/auto", "--to", "standard/auto", "-o", "b.cube"),
        ("apply", "camera.npz", "a.jpg", "--from", "standard/auto", "--to", "standard/2,1,1.4", "-o", "out"),
        ("apply", "camera.npz", "a.jpg", "--from", "standard/auto", "--space", "acescg", "-o", "light"),
        ("apply", "a.cube", "a.jpg", "-o", "again"),
    ):
        assert not loaded(tmp_path, *words) & tables, words


# --- Progress tells where work is, and when kernels compile -----------------------------------------------------------


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


# --- Progress is drawn on the terminal, and what a command prints goes where its output goes -------------------------


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
        said, _ = run.communicate(timeout=60)
    assert b"checking" in shown
    assert b"look.cube" in shown
    assert "9³ nodes" in said
    assert "9³ nodes".encode() not in shown
    assert "\x1b" not in said
