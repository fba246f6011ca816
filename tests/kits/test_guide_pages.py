"""The command lines of the guide's pages on programs run as they stand there, where the program is installed."""

import os
import re
import shutil
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rawpy
from PIL import Image

from lutforge.calibration.options import CalibrationOptions
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.kits import KITS
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_picture

pytestmark = pytest.mark.slow

GUIDE = Path(__file__).parents[2] / "examples" / "guide"
PAGES = ["film_luts", "other_programs", *sorted(name for name in KITS if (GUIDE / f"{name}.md").exists())]
RUNS = {
    "darktable": "darktable-cli", "rawtherapee": "rawtherapee-cli", "blender": "blender", "ffmpeg": "ffmpeg",
    "gimp": "gmic",
}  # fmt: skip
"""The program that a page runs, where it runs one."""


def command_lines(text: str) -> list[str]:
    """The indented lines of a page, in their order."""
    return re.findall(r"^ {4}(\S.*)$", text, flags=re.MULTILINE)


@pytest.fixture(scope="module")
def camera(s40_samples: SampleSet, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A profile of RAW files, which knows daylight and a second style, too."""
    path = tmp_path_factory.mktemp("camera") / "camera.npz"
    names = np.where(s40_samples.shot == s40_samples.shot[0], "daylight", s40_samples.white_balance)
    profile = calibrate(replace(s40_samples, white_balance=names), CalibrationOptions(size=9))
    replace(profile, styles={**profile.styles, "vivid": profile.styles["standard"]}).save(path)
    return path


@pytest.mark.parametrize("page", PAGES)
def test_the_lines_of_a_page_run(page: str, camera: Path, shared_data: Path, tmp_path: Path) -> None:
    lines = command_lines((GUIDE / f"{page}.md").read_text(encoding="utf-8"))
    assert lines
    program = RUNS.get(page)
    if program and shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")
    prepare(tmp_path, camera, shared_data, "\n".join(lines))
    environment = {**os.environ, "PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}", "HOME": str(tmp_path)}
    for line in lines:
        run = subprocess.run(
            ["/bin/sh", "-ec", line], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
        )
        assert run.returncode == 0, f"{line}\n{run.stdout[-500:]}{run.stderr[-1500:]}"
        for tiles, mean in re.findall(r"^IMG_0117\.CRW +(\d+) +(\d+\.\d+)", run.stdout, flags=re.MULTILINE):
            assert int(tiles) > 100
            assert float(mean) < 3.0  # a photograph that was not seen; RawTherapee's own curve has 3.3
    for made in re.findall(r"\S+\.(?:tif|mov)\b|OUT\.png", "\n".join(line for line in lines if "IN." in line)):
        assert (tmp_path / made).stat().st_size > 0


def prepare(folder: Path, camera: Path, data: Path, lines: str) -> None:
    """What a page takes for granted: `lutforge` on the path, photographs, a profile, pictures, a film, a scene."""
    (folder / "bin").mkdir()
    command = folder / "bin" / "lutforge"
    command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m lutforge "$@"\n')
    command.chmod(command.stat().st_mode | stat.S_IXUSR)
    shutil.copy(camera, folder / "camera.npz")
    shutil.copy(camera, folder / "other.npz")
    for raw in (data / "canon_powershot_s40").glob("CRW_*.CRW"):
        (folder / raw.name.replace("CRW_", "IMG_")).symlink_to(raw)
    if "--developed exported" in lines:
        (folder / "exported").mkdir()
        for raw in folder.glob("IMG_*.CRW"):
            export(raw, folder / "exported" / f"{raw.stem}.tif")
    if "IMG_*.JPG" in lines:
        shutil.copy(data / "canon_powershot_s40" / "IMG_0102.JPG", folder)
    if "film.cube" in lines:
        corners = [f"{r} {g} {b}" for b in (0, 1) for g in (0, 1) for r in (0, 1)]
        (folder / "film.cube").write_text("\n".join(["LUT_3D_SIZE 2", *corners, ""]), encoding="utf-8")
    if "IN." in lines:
        even = np.linspace(0, 255, 64).astype(np.uint8)
        picture = np.stack([*np.meshgrid(even, even), np.full((64, 64), 128, np.uint8)], axis=-1)
        Image.fromarray(picture).save(folder / "IN.png")
    if "IN.mov" in lines:
        film = ["ffmpeg", "-loglevel", "error", "-loop", "1", "-t", "0.2", "-i", "IN.png", "IN.mov"]
        subprocess.run(film, cwd=folder, check=True)
    if "scene.blend" in lines:
        script = (
            "import bpy\nscene = bpy.context.scene\nscene.render.engine = 'CYCLES'\nscene.cycles.samples = 1\n"
            "scene.cycles.use_denoising = False\nscene.render.resolution_x = scene.render.resolution_y = 32\n"
            f"bpy.ops.wm.save_as_mainfile(filepath={str(folder / 'scene.blend')!r})\n"
        )
        blender = ["blender", "--background", "--factory-startup", "--python-expr", script]
        subprocess.run(blender, check=True, capture_output=True)


def export(raw: Path, path: Path) -> None:
    """As another program would: ProPhoto RGB behind its own curve, 16 bit."""
    with rawpy.imread(str(raw)) as opened:
        pixels = opened.postprocess(
            output_color=rawpy.ColorSpace.ProPhoto, gamma=(1.8, 16), no_auto_bright=True, use_camera_wb=True,
            output_bps=16, user_flip=0,
        )  # fmt: skip
    write_picture(path, kind="uint16", pixels=(pixels / 65535).astype(np.float32))
