"""Every command of the guide's pages on cameras without RAW and on drones, one after the other, as it is written."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest
from PIL import Image

from lutforge.colour.spectra import reflectances
from lutforge.samples.chart_kinds import chart_kind
from lutforge.simulate.camera import nikon_d5100, sigma_sd_merrill
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES
from tests.cases.charts import photograph_chart
from tests.test_documentation import ROOT
from tests.trials.test_readme_commands import run

PAGES = [(ROOT / "examples" / "guide" / name).read_text(encoding="utf-8") for name in ("without_raw.md", "drones.md")]
LINES = re.findall(r"^ {4}(lutforge .*)", "\n".join(PAGES), re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Photographs named as the page names them: exposures of a chart, frames, a film, scenes by two cameras."""
    there, camera = tmp_path_factory.mktemp("without_raw"), nikon_d5100()
    for name in ("bracket", "chart", "raw", "jpeg"):
        (there / name).mkdir()
    kind = chart_kind("classic")
    for file in photograph_chart(camera, kind, reflectances(kind.spectra), there / "chart"):
        shutil.copy(file, there / "bracket")
    frames = photograph_chart(camera, kind, reflectances(kind.spectra), there, (-3.0, -2.0, -1.0, 0.0, 1.0))
    for number, file in enumerate(frames):
        Image.open(file).save(there / f"frame_{number}.png")
        file.unlink()
    film = ["-framerate", "1", "-i", "frame_%d.png", "-r", "10", "-c:v", "libx264rgb", "-qp", "0", "ramp.mp4"]
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
def test_they_run_as_written(folder: Path) -> None:
    assert len(LINES) >= 12
    for line in LINES:
        if ".mp4" in line and shutil.which("ffmpeg") is None:
            continue
        ran = run(line.replace('"Drone 7"', "Drone_7"), folder)
        assert ran.returncode == 0, f"{line}: {ran.stderr}"
        for output in re.findall(r"-o (\S+)", line):
            assert (folder / output).exists()
