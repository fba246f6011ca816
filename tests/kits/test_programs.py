"""The programs themselves, with the kits, on real RAW files; they skip where a program or the files are missing."""

import os
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.errors import LutForgeError, ShotError
from lutforge.images.read import read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.developing import left_side
from lutforge.pipeline.kits import check_kit, write_kit
from lutforge.pipeline.sampling import gather_samples
from lutforge.samples.sample_set import SampleSet

pytestmark = pytest.mark.slow

PROGRAMS = {"darktable": "darktable-cli", "rawtherapee": "rawtherapee-cli"}


@pytest.fixture(scope="module")
def raw_profile(s40_samples: SampleSet) -> CameraProfile:
    """Calibrated from RAW files."""
    return calibrate(s40_samples, CalibrationOptions(size=17))


def need(program: str) -> None:
    """Skip where a program is not installed."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_a_program_shows_the_camera_as_its_jpegs_do(program: str, shared_data: Path, tmp_path: Path) -> None:
    need(PROGRAMS[program])
    files = sorted((shared_data / "canon_powershot_s40").glob("CRW_*.CRW"))
    kept, others = files[3], [*files[:3], *files[4:]]
    profile = calibrate(gather_samples(others, left=left_side(program)).samples)
    assert str(profile.options["developer"]).startswith(program)
    folder = write_kit(profile, "standard/auto", tmp_path / "kit")
    (check,), failed = check_kit(folder, [kept])
    assert not failed
    assert check.tiles > 100
    assert check.mean < 3.0  # a shot that was not seen; LutForge on RAW has 2.55, RawTherapee's own curve 3.4


def test_a_dng_profile_in_rawtherapee(shared_data: Path, tmp_path: Path) -> None:
    need("rawtherapee-cli")
    files = sorted((shared_data / "canon_powershot_s40").glob("CRW_*.CRW"))
    folder = write_kit(calibrate(gather_samples(files).samples), "standard/auto", tmp_path / "r&d | kit", "rawtherapee")
    checks, failed = check_kit(folder, [files[0], files[3]])
    assert not failed
    assert all(check.mean < 1.0 for check in checks)  # the shots were seen: how near the format comes


def test_what_a_program_cannot_read_is_one_line(tmp_path: Path) -> None:
    need("darktable-cli")
    broken = tmp_path / "broken.CRW"
    broken.write_bytes(b"no camera wrote this" * 100)
    with pytest.raises(LutForgeError) as raised:
        gather_samples([broken], left=left_side("darktable"))
    assert len(str(raised.value).splitlines()) == 1
    assert "broken.CRW" in str(raised.value)


def test_a_missing_program_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(ShotError, match="apt install darktable"):
        left_side("darktable")


def test_blender_renders_with_the_config(raw_profile: CameraProfile, tmp_path: Path) -> None:
    need("blender")
    folder = write_kit(raw_profile, "standard/auto", tmp_path / "kit", "blender")
    view = re.findall(r'view transform "([^"]+)"', (folder / "README.md").read_text(encoding="utf-8"))[0]
    script = (
        "import bpy\n"
        "scene = bpy.context.scene\n"
        f"scene.view_settings.view_transform = {view!r}\n"
        "scene.render.resolution_x = scene.render.resolution_y = 32\n"
        "scene.render.engine = 'BLENDER_WORKBENCH'\n"
        f"scene.render.filepath = {str(tmp_path / 'picture.png')!r}\n"
        "picture = bpy.data.images.new('grey', 32, 32, float_buffer=True)\n"
        "picture.pixels = [0.18, 0.18, 0.18, 1.0] * 32 * 32\n"
        f"picture.save_render({str(tmp_path / 'picture.png')!r})\n"
    )
    command = [str(folder / "blender.sh"), "--background", "--factory-startup", "--python-exit-code", "3"]
    run = subprocess.run(
        [*command, "--python-expr", script], capture_output=True, text=True, check=False, timeout=300,
        env={**os.environ, "HOME": str(tmp_path)},
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    grey = read_image(tmp_path / "picture.png").pixels[16, 16, :3]
    wanted = raw_profile.render("standard/auto")(np.full(3, 0.18) / raw_profile.multipliers("standard/auto"))
    assert np.abs(grey - wanted).max() < 0.02


def test_ffmpeg_runs_the_line_of_the_page(raw_profile: CameraProfile, tmp_path: Path) -> None:
    need("ffmpeg")
    folder = write_kit(raw_profile, "standard/auto", tmp_path / "kit", "ffmpeg")
    line = re.findall(r"ffmpeg .*", (folder / "README.md").read_text(encoding="utf-8"))[0]
    make = ["ffmpeg", "-loglevel", "error", "-f", "lavfi", "-i", "color=gray:s=32x32:d=0.2", str(folder / "IN.mov")]
    subprocess.run(make, check=True)
    subprocess.run(line, shell=True, check=True, cwd=folder, capture_output=True)
    assert (folder / "OUT.mov").stat().st_size > 0
