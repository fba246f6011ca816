"""Commands start quickly: each imports what it needs and no other library."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lutforge.model.camera_profile import CameraProfile
from lutforge.model.profile_data import PictureStyle
from lutforge.model.profile_file import save_profile
from lutforge.model.white_balance import WhiteBalance
from lutforge.samples.sample_set import SampleSet
from lutforge.samples.table import write_samples
from tests.apply.graded_images import write_cube, write_picture

SLOW = {
    "numba", "scipy", "pandas", "matplotlib", "jinja2", "colour", "rawpy", "exifread", "OpenImageIO",
    "PyOpenColorIO", "PIL", "simplejpeg", "panel", "bokeh", "distributed", "cv2", "numpy",
}  # fmt: skip
"""Libraries that take longer to load than Python itself."""


def loaded(folder: Path, *words: str) -> set[str]:
    """Which of the slow libraries a command has loaded when it ends."""
    code = f"""if True:
        import atexit, sys
        sys.argv[0] = "lutforge"
        atexit.register(lambda: print("loaded", *(name for name in {sorted(SLOW)} if name in sys.modules)))
        from lutforge.cli.main import main
        main()
        """
    run = subprocess.run(
        [sys.executable, "-c", code, *words], cwd=folder, capture_output=True, text=True, check=False, timeout=100
    )
    assert run.returncode == 0, run.stderr
    return set(run.stdout.splitlines()[-1].split()[1:])


@pytest.mark.parametrize("words", [("--help",), ("--version",), ("apply", "--help"), ("calibrate", "--help")], ids=str)
def test_help_loads_nothing(tmp_path: Path, words: tuple[str, ...]) -> None:
    assert loaded(tmp_path, *words) == set()


def test_inspecting_a_profile_loads_numpy_alone(tmp_path: Path) -> None:
    balances = {"daylight": WhiteBalance((2.0, 1.0, 1.5))}
    save_profile(CameraProfile("A Camera", np.eye(3), balances, {"standard": PictureStyle()}), tmp_path / "camera.npz")
    assert loaded(tmp_path, "inspect", "camera.npz") == {"numpy"}


@pytest.mark.parametrize("suffix", [".jpg", ".tif"])
def test_grading_with_a_lut_loads_what_reads_grades_and_writes(tmp_path: Path, suffix: str) -> None:
    write_cube(tmp_path / "look.cube")
    write_picture(tmp_path / f"a{suffix}")
    found = loaded(tmp_path, "apply", "look.cube", f"a{suffix}", "-o", "out")
    assert (tmp_path / "out" / f"a{suffix}").exists()
    assert found <= {"numpy", "OpenImageIO", "PyOpenColorIO", "PIL", "simplejpeg"}


def test_calibrating_a_table_loads_nothing_that_reads_pictures(tmp_path: Path, s40_samples: SampleSet) -> None:
    write_samples(tmp_path / "samples.csv", s40_samples)
    found = loaded(tmp_path, "calibrate", "samples.csv", "--size", "5")
    assert not found & {"rawpy", "exifread", "OpenImageIO", "PIL", "cv2", "colour", "pandas", "matplotlib", "jinja2"}
