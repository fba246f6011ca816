"""Every command of the README, run as it is written, on photographs by a simulated camera."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from lutforge.colour.spectra import reflectances
from lutforge.samples.chart_kinds import chart_kind
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.demo import demo_shots
from tests.cases.charts import photograph_chart
from tests.test_documentation import README, commands

LINES = [line for line in dict.fromkeys(commands(README)) if "studio" not in line]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs named as the README names them, a chart's too, the profile made of them, and two copies of it."""
    made, there = tmp_path_factory.mktemp("made"), tmp_path_factory.mktemp("readme")
    shots = demo_shots(made, shape=(400, 600))
    for number, raw in enumerate(shots.calibration, start=1):
        shutil.copy(raw, there / f"IMG_{number:04d}.DNG")
        for jpeg in raw.parent.glob(f"{raw.stem}.[jJ]*"):
            shutil.copy(jpeg, there / f"IMG_{number:04d}.JPG")
    (there / "chart").mkdir()
    kind = chart_kind("classic")
    photograph_chart(nikon_d5100(), kind, reflectances(kind.spectra), there / "chart")
    first = next(line for line in LINES if line.startswith("lutforge calibrate"))
    ran = run(first, there)
    assert ran.returncode == 0, ran.stderr
    for copy in ("a.npz", "b.npz"):
        shutil.copy(there / "camera.npz", there / copy)
    return there


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a line as a shell would: with its patterns of file names filled in."""
    words: list[str] = []
    for word in line.split()[1:]:
        words.extend(sorted(path.name for path in folder.glob(word)) if "*" in word else [word])
    command = [sys.executable, "-m", "lutforge", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)


def test_the_readme_has_the_commands_that_are_tried() -> None:
    kinds = {line.split()[1] for line in LINES}
    assert kinds >= {"calibrate", "report", "bake", "apply", "config"}


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_it_runs_as_written(line: str, folder: Path) -> None:
    ran = run(line, folder)
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    for output in re.findall(r"-o (\S+)", line):
        made = folder / output
        assert made.stat().st_size > 0
        assert made.is_file() or any(made.iterdir())
