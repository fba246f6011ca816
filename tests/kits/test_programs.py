"""The programs themselves, with the kits, on real RAW files; they skip where a program or the files are missing."""

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
from lutforge.errors import LutForgeError
from lutforge.images.read import read_image
from lutforge.kits.all_kits import KITS
from lutforge.model.camera_profile import CameraProfile
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.kit_checks import check_kit
from lutforge.pipeline.kits import write_kit
from lutforge.pipeline.sampling import gather_samples
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_picture

pytestmark = pytest.mark.slow

PROGRAMS = {"darktable": "darktable-cli", "rawtherapee": "rawtherapee-cli"}


def need(program: str) -> None:
    """Skip where a program is not installed."""
    if shutil.which(program) is None:
        pytest.skip(f"{program} is not installed")


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_a_camera_profile_in_its_program(program: str, shared_data: Path, tmp_path: Path) -> None:
    need(PROGRAMS[program])
    files = sorted((shared_data / "canon_powershot_s40").glob("CRW_*.CRW"))
    folder = write_kit(calibrate(gather_samples(files[:4]).samples), "standard", tmp_path / "r&d | kit", program)
    checks, failed = check_kit(folder, [files[0], files[4]])
    assert not failed
    assert [check.calibrated for check in checks] == [True, False]
    assert checks[0].mean < 1.0  # a shot that was seen: how near the format comes


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_what_a_program_cannot_read_is_one_line(program: str, profile: CameraProfile, tmp_path: Path) -> None:
    need(PROGRAMS[program])
    broken = tmp_path / "broken.CRW"
    broken.write_bytes(b"no camera wrote this" * 100)
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", program)
    with pytest.raises(LutForgeError) as raised:
        check_kit(kit, [broken])
    assert len(str(raised.value).splitlines()) == 1
    assert "broken.CRW" in str(raised.value)
    assert program in str(raised.value).lower()


@pytest.mark.parametrize("program", sorted(PROGRAMS))
def test_a_damaged_kit_is_one_line(program: str, profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    """The programs show their own colours with it, without a word."""
    need(PROGRAMS[program])
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", program)
    damaged = next(kit.glob("*standard.dcp" if program == "rawtherapee" else "*standard.icc"))
    whole, output = damaged.read_bytes(), tmp_path / "out.tif"
    raw = str(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    middle = len(whole) // 2
    for spoilt in (whole[:middle], whole[:middle] + bytes(9) + whole[middle + 9 :], b"", None):
        damaged.unlink(missing_ok=True)
        if spoilt is not None:
            damaged.write_bytes(spoilt)
        run = subprocess.run([str(kit / "develop.sh"), raw, str(output)], capture_output=True, text=True)
        assert run.returncode == 1
        assert "a camera profile of the kit is damaged" in run.stderr
        assert damaged.name in run.stderr
        assert len(run.stderr.splitlines()) == 1
        assert not output.exists()


def test_a_darktable_that_cannot_use_the_kit_is_told(profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    """Parameters that this darktable does not know: it would show its own colours."""
    need("darktable-cli")
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", "darktable")
    for sidecar in kit.glob("*.xmp"):
        sidecar.write_text(sidecar.read_text(encoding="utf-8").replace('modversion="7"', 'modversion="99"'))
    raw = str(shared_data / "canon_powershot_s40" / "CRW_0101.CRW")
    command = [str(kit / "develop.sh"), raw, str(tmp_path / "out.tif")]
    run = subprocess.run(command, capture_output=True, text=True)
    assert run.returncode == 1
    assert "did not use the profile" in run.stderr
    assert not (tmp_path / "out.tif").exists()


def test_the_style_is_the_sidecar(profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    """Imported by darktable itself, as its window does, and applied to a photograph."""
    need("darktable-cli")
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", "darktable")
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    place = tmp_path / "config" / "color" / "in"
    place.mkdir(parents=True)
    shutil.copy(kit / "Canon PowerShot S40 standard.icc", place)
    command = [
        "darktable-cli", str(raw), str(tmp_path / "style.tif"), "--icc-type", "SRGB",
        *("--style", "Canon PowerShot S40 standard", "--core", "--configdir", str(tmp_path / "config")),
        *("--library", ":memory:", "--conf", "plugins/imageio/format/tiff/bpp=16"),  # preferences as they come
        *("--luacmd", f'require("darktable").styles.import("{kit / "Canon PowerShot S40 standard.dtstyle"}")'),
    ]  # fmt: skip
    subprocess.run(command, check=True, capture_output=True)
    subprocess.run([str(kit / "develop.sh"), str(raw), str(tmp_path / "sidecar.tif")], check=True, capture_output=True)
    by_style, by_sidecar = (read_image(tmp_path / name).pixels for name in ("style.tif", "sidecar.tif"))
    # Beside a sidecar darktable sharpens edges a little by itself; away from them the two are equal.
    assert np.median(np.abs(by_style - by_sidecar)) < 2e-5
    assert np.abs(by_style - by_sidecar).mean() < 0.002


@pytest.mark.parametrize("preset", ["", " icc", " colours"])
def test_processing_profiles_by_hand(preset: str, profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    """Loaded from the kit's folder, as its page says."""
    need("rawtherapee-cli")
    kit = write_kit(profile, "standard/auto", tmp_path / "kit", "rawtherapee")
    raw, look = str(shared_data / "canon_powershot_s40" / "CRW_0101.CRW"), f"Canon PowerShot S40 standard{preset}"
    by_hand = ["rawtherapee-cli", "-o", str(tmp_path / "hand.tif"), "-p", str(kit / f"{look}.pp3"), "-t", "-b16", "-Y"]
    subprocess.run([*by_hand, "-c", raw], check=True, capture_output=True)
    script = [str(kit / "develop.sh"), raw, str(tmp_path / "script.tif"), look]
    subprocess.run(script, check=True, capture_output=True)
    hand, scripted = (read_image(tmp_path / name).pixels for name in ("hand.tif", "script.tif"))
    assert np.abs(hand - scripted).max() < 2e-4


def test_blender_renders_with_the_config(profile: CameraProfile, tmp_path: Path) -> None:
    need("blender")
    folder = write_kit(profile, "standard/auto", tmp_path / "kit", "blender")
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
        [*command, "--python-expr", script], capture_output=True, text=True, timeout=300,
        env={**os.environ, "HOME": str(tmp_path)},
    )  # fmt: skip
    assert run.returncode == 0, run.stdout + run.stderr
    grey = read_image(tmp_path / "picture.png").pixels[16, 16, :3]
    expected = profile.render("standard/auto")(np.full(3, 0.18) / profile.multipliers("standard/auto"))
    assert np.abs(grey - expected).max() < 0.02


def test_ffmpeg_runs_the_line_of_the_page(profile: CameraProfile, tmp_path: Path) -> None:
    need("ffmpeg")
    folder = write_kit(profile, "standard/auto", tmp_path / "kit", "ffmpeg")
    line = re.findall(r"ffmpeg .*", (folder / "README.md").read_text(encoding="utf-8"))[0]
    make = ["ffmpeg", "-loglevel", "error", "-f", "lavfi", "-i", "color=gray:s=32x32:d=0.2", str(folder / "IN.mov")]
    subprocess.run(make, check=True)
    subprocess.run(line, shell=True, check=True, cwd=folder, capture_output=True)
    assert (folder / "OUT.mov").stat().st_size > 0


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
        run = subprocess.run(["/bin/sh", "-ec", line], cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert run.returncode == 0, f"{line}\n{run.stdout[-500:]}{run.stderr[-1500:]}"
        for tiles, mean in re.findall(r"^IMG_0117\.CRW +(\d+) +(\d+\.\d+)", run.stdout, flags=re.MULTILINE):
            assert int(tiles) > 100
            assert float(mean) < 3.0  # a photograph that was not seen; RawTherapee's own curve has 3.3
    for made in re.findall(r"[^\s:]+\.(?:tif|mov)\b|OUT\.png", "\n".join(line for line in lines if "IN." in line)):
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
    # Without a screen mpv shows nothing.
    (folder / ".config" / "mpv").mkdir(parents=True)
    (folder / ".config" / "mpv" / "mpv.conf").write_text("vo=null\n", encoding="utf-8")
    if "IN." in lines:
        even = np.linspace(0, 255, 64).astype(np.uint8)
        picture = np.stack([*np.meshgrid(even, even), np.full((64, 64), 128, np.uint8)], axis=-1)
        Image.fromarray(picture).save(folder / "IN.png")
        write_picture(folder / "IN16.png", kind="uint16", pixels=(picture / 255).astype(np.float32))
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
