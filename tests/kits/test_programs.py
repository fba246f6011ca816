"""The programs themselves, with the kits, on real RAW files; they skip where a program or the files are missing."""

import os
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.developers.darktable import Darktable
from lutforge.errors import LutForgeError, ShotError
from lutforge.images.read import read_image
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.kits import check_kit, write_kit
from lutforge.pipeline.raw_substitutes import raw_substitute
from lutforge.pipeline.sampling import gather_samples
from lutforge.samples.sample_set import SampleSet

pytestmark = pytest.mark.slow

PROGRAMS = {"darktable": "darktable-cli", "rawtherapee": "rawtherapee-cli"}


@pytest.fixture(scope="module")
def raw_profile(s40_samples: SampleSet) -> CameraProfile:
    """Calibrated from RAW files."""
    return calibrate(s40_samples, CalibrationOptions(size=17))


@pytest.fixture(scope="module")
def developed_profile(raw_profile: CameraProfile) -> CameraProfile:
    """A look for what darktable develops, whatever its colours."""
    left = {"raw_space": "linear-rec2020", "developer": "darktable 4.2.1"}
    return replace(raw_profile, options={**raw_profile.options, **left})


def need(program: str) -> None:
    """Skip where a program is not installed."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")


def test_a_dng_profile_in_rawtherapee(shared_data: Path, tmp_path: Path) -> None:
    need("rawtherapee-cli")
    files = sorted((shared_data / "canon_powershot_s40").glob("CRW_*.CRW"))
    folder = write_kit(calibrate(gather_samples(files).samples), "standard/auto", tmp_path / "r&d | kit", "rawtherapee")
    checks, failed = check_kit(folder, [files[0], files[3]])
    assert not failed
    assert all(check.mean < 1.0 for check in checks)  # the shots were seen: how near the format comes


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_what_a_program_cannot_read_is_one_line(
    program: str, raw_profile: CameraProfile, developed_profile: CameraProfile, tmp_path: Path
) -> None:
    need(PROGRAMS[program])
    broken = tmp_path / "broken.CRW"
    broken.write_bytes(b"no camera wrote this" * 100)
    kit = write_kit(developed_profile if program == "darktable" else raw_profile, "standard/auto", tmp_path / "kit")
    for attempt in (
        lambda: gather_samples([broken], substitute=raw_substitute(program)),
        lambda: check_kit(kit, [broken]),
    ):
        with pytest.raises(LutForgeError) as raised:
            attempt()
        assert len(str(raised.value).splitlines()) == 1
        assert "broken.CRW" in str(raised.value)
        assert program in str(raised.value).lower()


def test_darktable_of_another_version_than_the_kits_is_one_line(
    developed_profile: CameraProfile, shared_data: Path, tmp_path: Path
) -> None:
    """A kit for parameters that this darktable does not know: it would show the photograph without the LUT."""
    need("darktable-cli")
    kit = write_kit(developed_profile, "standard/auto", tmp_path / "kit")
    sidecar = kit / "lutforge.xmp"
    later = sidecar.read_text(encoding="utf-8").replace('modversion="1"', 'modversion="99"')
    sidecar.write_text(later, encoding="utf-8")
    raw = str(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    command = [str(kit / "develop.sh"), raw, str(tmp_path / "out.tif")]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.returncode == 1
    assert "did not use the LUT" in run.stderr
    assert not (tmp_path / "out.tif").exists()


def test_the_style_is_the_sidecar(developed_profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    """Imported by darktable itself, as its window does, and applied to a photograph."""
    need("darktable-cli")
    kit = write_kit(developed_profile, "standard/auto", tmp_path / "kit")
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    (style,) = kit.glob("*.dtstyle")
    neutral = Darktable().command(raw, tmp_path / "style.tif", tmp_path)
    command = [
        *("SRGB" if word == "LIN_REC2020" else word for word in neutral[:5]),
        *("--style", "Canon PowerShot S40 standard", *neutral[5:]),
        *("--conf", f"plugins/darkroom/lut3d/def_path={kit}"),
        *("--luacmd", f'require("darktable").styles.import("{style}")'),
    ]
    subprocess.run(command, check=True, capture_output=True)
    subprocess.run([str(kit / "develop.sh"), str(raw), str(tmp_path / "sidecar.tif")], check=True, capture_output=True)
    by_style, by_sidecar = (read_image(tmp_path / name).pixels for name in ("style.tif", "sidecar.tif"))
    # Beside a sidecar darktable sharpens edges a little by itself; away from them the two are equal.
    assert np.median(np.abs(by_style - by_sidecar)) < 2e-5
    assert np.abs(by_style - by_sidecar).mean() < 0.002


def test_darktables_own_workflow_is_not_taken_for_neutral(shared_data: Path, tmp_path: Path) -> None:
    """As of a version that knows the settings of a neutral development no longer."""
    need("darktable-cli")
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    command = Darktable().command(raw, tmp_path / "out.tif", tmp_path)
    subprocess.run(command[: command.index("--conf")], capture_output=True, check=False)
    assert "exposure, filmicrgb" in Darktable().objection(tmp_path / "out.tif")


@pytest.mark.parametrize("kind", ["raw", "developed"])
def test_a_processing_profile_works_by_hand(
    kind: str, raw_profile: CameraProfile, developed_profile: CameraProfile, shared_data: Path, tmp_path: Path
) -> None:
    """Loaded from the kit's folder, the CLUT copied into the user's folder of CLUTs, as its page says."""
    need("rawtherapee-cli")
    options = {**developed_profile.options, "developer": "rawtherapee 5.9"}
    profile = raw_profile if kind == "raw" else replace(developed_profile, options=options)
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", "rawtherapee")
    raw = str(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    settings, cluts = tmp_path / "settings", tmp_path / "cluts"
    settings.mkdir()
    cluts.mkdir()
    (settings / "options").write_text(f"[Color Management]\nClutsDirectory={cluts}\n")
    for clut in kit.glob("*.png"):
        shutil.copy(clut, cluts)
    environment = {**os.environ, "RT_SETTINGS": str(settings)}
    by_hand = ["rawtherapee-cli", "-o", str(tmp_path / "hand.tif"), "-p", str(kit / "lutforge.pp3"), "-t", "-b16", "-Y"]
    subprocess.run([*by_hand, "-c", raw], check=True, capture_output=True, env=environment)
    subprocess.run([str(kit / "develop.sh"), raw, str(tmp_path / "script.tif")], check=True, capture_output=True)
    hand, script = (read_image(tmp_path / name).pixels for name in ("hand.tif", "script.tif"))
    assert np.abs(hand - script).max() < 2e-4


def test_a_missing_program_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(ShotError, match="apt install darktable"):
        raw_substitute("darktable")


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
