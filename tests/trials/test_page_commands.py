"""Every command of the README, and of the guide on cameras without RAW, run as it is written."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from PIL import Image

from lutforge.cli.demo_shots import demo_shots
from lutforge.colour.spectra import reflectances
from lutforge.samples.chart import chart_kind
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.dials import CameraSettings
from lutforge.simulate.photograph import photograph
from lutforge.simulate.scenes import SCENES
from tests.cases.charts import photograph_chart
from tests.test_documentation import README, ROOT, commands

LINES = [line for line in dict.fromkeys(commands(README)) if "studio" not in line]
PAGES = [(ROOT / "examples" / "guide" / name).read_text(encoding="utf-8") for name in ("without_raw.md", "drones.md")]
WITHOUT_RAW = re.findall(r"^ {4}((?:lutforge|ffmpeg) .*)", "\n".join(PAGES), re.MULTILINE)


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


def with_named_balance(line: str) -> str:
    """A line for the demo's camera, whose shots have white balances set by hand, as the README says to write it."""
    return line if "phone.npz" in line else line.replace("/auto", "/daylight")


def run(line: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """Run a line as a shell would: with its patterns of file names filled in."""
    words: list[str] = []
    for word in line.split()[1:]:
        words.extend(sorted(path.name for path in folder.glob(word)) if "*" in word else [word])
    command = [sys.executable, "-m", "lutforge", *words]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600)


def test_the_readme_has_the_commands_that_are_tried() -> None:
    kinds = {line.split()[1] for line in LINES}
    assert kinds >= {"calibrate", "report", "bake", "apply", "config"}


@pytest.mark.slow
@pytest.mark.parametrize("line", LINES)
def test_it_runs_as_written(line: str, folder: Path) -> None:
    ran = run(with_named_balance(line), folder)
    assert ran.returncode == 0, ran.stderr
    assert "Traceback" not in ran.stderr
    for output in re.findall(r"-o (\S+)", line):
        made = folder / output
        assert made.stat().st_size > 0
        assert made.is_file() or any(made.iterdir())


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs named as the page names them: exposures of a chart, frames, a film, scenes by two cameras."""
    there, camera = tmp_path_factory.mktemp("without_raw"), nikon_d5100()
    for name in ("bracket", "chart", "raw", "jpeg"):
        (there / name).mkdir()
    kind = chart_kind("classic")
    for file in photograph_chart(camera, kind, reflectances(kind.spectra), there / "chart"):
        shutil.copy(file, there / "bracket")
    shutil.copy(sorted((there / "chart").iterdir())[2], there / "chart.jpg")
    frames = photograph_chart(camera, kind, reflectances(kind.spectra), there, (-3, -2, -1, 0, 1))
    for number, file in enumerate(frames):
        Image.open(file).save(there / f"frame_{number}.png")
        file.unlink()
    film = ["-framerate", "0.5", "-i", "frame_%d.png", "-r", "10", "-c:v", "libx264rgb", "-qp", "0", "ramp.mp4"]
    if shutil.which("ffmpeg"):
        subprocess.run(["ffmpeg", "-v", "error", *film], cwd=there, check=True)
    shots = [(style, dial) for style in ("standard", "vivid") for dial in ("daylight", "tungsten")]
    for number, (style, dial) in enumerate(2 * shots):
        scene, stop = SCENES["wall"](808, 1216, number), 2.0 ** -(number // 4)
        sides = ((camera, ("standard", "daylight"), "raw"), (sigma_sd_merrill(), (style, dial), "jpeg"))
        for one, dials, part in sides:
            settings = CameraSettings(*dials, one.nominal_exposure_s * stop)
            beside = part == "jpeg"
            photograph(one, scene, settings, there / part, f"scene{number}", jpeg_beside=beside, light="daylight")
    for file in (there / "jpeg").glob("*.dng"):
        file.unlink()
    return there


@pytest.mark.slow
def test_commands_without_raw_run_as_written(scenes: Path) -> None:
    assert len(WITHOUT_RAW) >= 12
    for line in WITHOUT_RAW:
        if line.startswith("ffmpeg"):
            if shutil.which("ffmpeg") is not None:
                subprocess.run(shlex.split(line), cwd=scenes, check=True, capture_output=True)
            continue
        if "exposure_" in line and shutil.which("ffmpeg") is None:
            continue
        ran = run(line.replace('"Drone 7"', "Drone_7"), scenes)
        assert ran.returncode == 0, f"{line}: {ran.stderr}"
        for output in re.findall(r"-o (\S+)", line):
            assert (scenes / output).exists()
