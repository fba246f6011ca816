"""Commands start quickly: each imports what it needs and no other library."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile import PictureStyle
from lutforge.model.white_balance import WhiteBalance
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
    assert loaded == {"lutforge.cli.main", "lutforge.cli.console", "lutforge.cli.inspection"}


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
def test_commands_on_the_way_of_the_data_load_nothing_of_reports_and_charts(
    tmp_path: Path, s40_samples: SampleSet
) -> None:
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
