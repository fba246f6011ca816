"""What kits hold, by second readers; the programs themselves are run in test_programs.py."""

import json
import os
import re
import subprocess
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib.colors import hsv_to_rgb, rgb_to_hsv
from PIL.TiffImagePlugin import ImageFileDirectory_v2
from scipy.ndimage import map_coordinates

from lutforge import __version__
from lutforge.arrays import Array
from lutforge.calibration.calibrate import calibrate
from lutforge.calibration.options import CalibrationOptions
from lutforge.colour.rgb_spaces import matrix_between, rgb_space
from lutforge.colour.srgb import delta_e_2000
from lutforge.errors import LutForgeError, SettingsError
from lutforge.images.raw import read_raw
from lutforge.images.read import read_image
from lutforge.kits.all_kits import KITS
from lutforge.kits.dcp import fit_dng_profile, read_dcp, write_dcp
from lutforge.kits.icc import fit_icc_profile, write_icc
from lutforge.kits.kit import look_of
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.model.provenance import Developed
from lutforge.pipeline.kit_checks import KitCheck, check_kit, compare_with_jpeg
from lutforge.pipeline.kits import write_kit
from lutforge.pipeline.transforms import TransformRequest, choose_transform
from lutforge.samples.sample_set import SampleSet
from tests.cases.pictures import write_picture
from tests.conftest import CommandLine

SETTING = "standard/auto"


@pytest.fixture(scope="module")
def developed_profile(profile: CameraProfile, s40_samples: SampleSet) -> CameraProfile:
    """As if a program had developed the RAW files: by the camera's matrix, to linear Rec. 2020."""
    balanced = s40_samples.raw * s40_samples.wb
    developed = np.clip(balanced @ (matrix_between("linear-srgb", "linear-rec2020") @ profile.matrix).T, 0.0, 1.0)
    samples = replace(s40_samples, raw=developed, wb=np.ones_like(s40_samples.wb))
    of_developed = calibrate(samples, CalibrationOptions(size=17))[0]
    return replace(of_developed, provenance=Developed("darktable 4.2.1", "linear-rec2020"))


def colours_of_photographs(samples: SampleSet) -> np.ndarray:
    """White-balanced RAW (n, 3) of the photographs that the profile was calibrated from."""
    return np.asarray((samples.raw * samples.wb)[::5])


@pytest.mark.usefixtures("small_profiles")  # of ICC, which the kit holds, too
def test_a_dng_profile_shows_the_look(profile: CameraProfile, s40_samples: SampleSet, tmp_path: Path) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "rawtherapee")
    tags = dcp_tags(folder / "Canon PowerShot S40 standard.dcp")
    assert tags[50708] == "Canon PowerShot S40"
    x = colours_of_photographs(s40_samples)
    difference = delta_e_2000(developed_by_dcp(tags, x), np.clip(look_of(profile, SETTING).render(x), 0.0, 1.0))
    assert difference.mean() < 0.4
    assert difference.max() < 3.0


@pytest.mark.parametrize(
    ("camera", "dng_camera", "stated"),
    [
        ("DJI FC300S", "FC300S", "FC300S"),
        ("Leica Q2", "", "LEICA Q2"),
        ("Ricoh GR III", "", "RICOH GR III"),
        ("Sigma fp", "", "SIGMA fp"),
        ("Sigma fp", "SIGMA fp", "SIGMA fp"),
    ],
)
def test_a_dng_profile_names_the_camera_as_its_raw_files_do(
    profile: CameraProfile, tmp_path: Path, camera: str, dng_camera: str, stated: str
) -> None:
    replace(profile, camera=camera, dng_camera=dng_camera).save(tmp_path / "camera.npz")
    look = look_of(load_profile(tmp_path / "camera.npz"), SETTING)
    write_dcp(fit_dng_profile(look), tmp_path / "look.dcp")
    assert dcp_tags(tmp_path / "look.dcp")[50708] == stated


@pytest.mark.usefixtures("small_profiles")
def test_camera_profiles_state_what_they_take_and_give(
    profile: CameraProfile, tmp_path: Path, lutforge: CommandLine
) -> None:
    style = replace(profile.styles["standard"], errors={"render_mean": 0.0123, "render_de00_mean": 1.15})
    look = look_of(replace(profile, styles={"standard": style}), SETTING)
    write_dcp(fit_dng_profile(look), tmp_path / "look.dcp")
    write_icc(fit_icc_profile(look), tmp_path / "look.icc")
    for name in ("look.dcp", "look.icc"):
        shown = lutforge("check", name, cwd=tmp_path).stdout
        for line in (
            f"LutForge {__version__}",
            "input: linear camera RAW behind its white balance",
            "output: ",
            "camera and settings: Canon PowerShot S40, standard/auto",
            "held-out render error: mean 3.14 codes of 255, dE00 1.15",
            "licence: CC0 1.0",
        ):
            assert f"comment   {line}" in shown, name


def test_white_stays_white_in_a_dng_profile(profile: CameraProfile) -> None:
    """Of a matrix whose rows do not sum to 1, too: developers scale a forward matrix so that it does."""
    style = profile.styles["standard"]
    models = tuple(replace(model, matrix=np.diag([0.87, 0.86, 0.91]) @ model.matrix) for model in style.models)
    darker = replace(profile, styles={"standard": replace(style, models=models)})
    forward = fit_dng_profile(look_of(darker, "standard")).forward_matrix
    assert np.allclose(forward.sum(axis=1), [0.9642, 1.0, 0.8251], atol=2e-3)  # D50


@pytest.mark.slow
@pytest.mark.parametrize("program", sorted(KITS))
def test_every_kit_says_what_it_is(program: str, profile: CameraProfile, tmp_path: Path) -> None:
    if program == "blender":
        pytest.skip("its config is written in test_programs.py")
    folder = write_kit(profile, SETTING, tmp_path / "kit", program.upper())
    text = (folder / "README.md").read_text(encoding="utf-8")
    assert KITS[program].tried in text
    assert all(path.name in text for path in folder.iterdir())
    assert len(text.splitlines()) < 30
    assert json.loads((folder / "kit.json").read_text(encoding="utf-8"))["shots"] == list(profile.shots)
    write_kit(profile, SETTING, folder, program)  # an older kit is replaced


def test_multipliers_on_top_of_a_programs_balance_are_told(developed_profile: CameraProfile, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"darktable .* already: instead of 2.1,1,1.4 .* standard/auto"):
        write_kit(developed_profile, "standard/2.1,1,1.4", tmp_path / "kit", "ffmpeg")
    described = choose_transform(developed_profile, TransformRequest("render", target="standard/2.1,1,1.4"))
    assert any("1,1,1 changes nothing" in text for text in described.purpose.notes)
    assert not choose_transform(developed_profile, TransformRequest("render", target=SETTING)).purpose.notes


@pytest.mark.parametrize("space", ["davinci-intermediate", "acescg"])
def test_a_look_in_a_space_is_the_cameras(space: str, developed_profile: CameraProfile, s40_samples: SampleSet) -> None:
    look = look_of(developed_profile, SETTING)
    x = np.random.default_rng(4).uniform(0.02, 0.6, (300, 3))
    linear = rgb_space(space).linear.name
    fed = rgb_space(space).encode(x @ matrix_between("linear-rec2020", linear).T)
    light = rgb_space(space).linearize(look.between(space, space)(fed)) @ matrix_between(linear, "linear-srgb").T
    shown = rgb_space("srgb").encode(np.clip(light, 0.0, 1.0))
    assert np.abs(shown - np.clip(look.render(x), 0.0, 1.0)).max() < 2e-3


def test_what_a_profile_cannot_give_is_refused_with_the_way(
    profile: CameraProfile, developed_profile: CameraProfile, tmp_path: Path
) -> None:
    for program in ("blender", "darktable", "rawtherapee", "lightroom"):
        with pytest.raises(SettingsError, match="needs a profile of RAW files"):
            write_kit(developed_profile, SETTING, tmp_path / "kit", program)
    with pytest.raises(SettingsError, match="--base and --as go with --for lumix"):
        write_kit(profile, SETTING, tmp_path / "kit", "nuke", base="standard")
    with pytest.raises(SettingsError, match='Canon PowerShot S40: unknown style "sepia" for --base; known: standard'):
        write_kit(profile, SETTING, tmp_path / "kit", "lumix", base="sepia")
    with pytest.raises(SettingsError, match="--as goes with --base"):
        write_kit(profile, SETTING, tmp_path / "kit", "lumix", look=profile)
    with pytest.raises(SettingsError, match="unknown kit"):
        write_kit(profile, SETTING, tmp_path / "kit", "paint")
    for word, name in {"mpv": "ffmpeg", "Camera-Raw": "lightroom", "camera raw": "lightroom", "G'MIC": "gimp"}.items():
        with pytest.raises(SettingsError, match=f"did you mean {name}, for "):
            write_kit(profile, SETTING, tmp_path / "kit", word)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "holiday.jpg").write_bytes(b"x")
    with pytest.raises(LutForgeError, match="holds other files"):
        write_kit(profile, SETTING, tmp_path / "mine", "nuke")
    assert not (tmp_path / "kit").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine"]
    (tmp_path / "mine" / "kit.json").write_text('["README.md"]')  # another program's file of that name
    with pytest.raises(LutForgeError, match="holds other files"):
        write_kit(profile, SETTING, tmp_path / "mine", "nuke")
    kit = write_kit(profile, SETTING, tmp_path / "kit", "nuke")
    with pytest.raises(LutForgeError, match="cannot be run from the command line"):
        check_kit(kit, ["a.CRW"])
    (kit / "project.nk").write_text("mine too")
    with pytest.raises(LutForgeError, match="holds other files"):
        write_kit(profile, SETTING, kit, "nuke")
    assert (kit / "project.nk").is_file()


@pytest.mark.slow
def test_a_picture_is_compared_with_the_jpeg(shared_data: Path, s40_samples: SampleSet, tmp_path: Path) -> None:
    raw = shared_data / "canon_powershot_s40" / "CRW_0101.CRW"
    jpeg = read_raw(raw).preview
    assert jpeg is not None
    (tmp_path / "same.jpg").write_bytes(jpeg)
    check = compare_with_jpeg(raw, tmp_path / "same.jpg")
    assert check.shot == "CRW_0101.CRW"
    assert check.tiles == np.count_nonzero(s40_samples.shot == "CRW_0101")
    assert check.maximum < 0.1
    # What a program clips is an error of its picture, and counts; how its picture lies does not.
    pixels = read_image(tmp_path / "same.jpg").pixels
    turned = np.ascontiguousarray(np.rot90(np.minimum(pixels * 1.5, 1.0)), np.float32)
    write_picture(tmp_path / "clipped.tif", kind="uint16", pixels=turned)
    clipped = compare_with_jpeg(raw, tmp_path / "clipped.tif")
    assert clipped.tiles == check.tiles
    assert clipped.mean > 5.0


@pytest.mark.usefixtures("small_profiles")
def test_a_script_that_cannot_be_run_is_one_line(profile: CameraProfile, shared_data: Path, tmp_path: Path) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "rawtherapee")
    (folder / "develop.sh").chmod(0o644)  # as some archives leave it
    with pytest.raises(LutForgeError, match=r"develop\.sh cannot be run"):
        check_kit(folder, [shared_data / "canon_powershot_s40" / "CRW_0101.CRW"])


@pytest.mark.usefixtures("small_profiles")
def test_scripts_say_what_is_missing(profile: CameraProfile, tmp_path: Path) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "rawtherapee")
    script = str(folder / "develop.sh")
    usage = subprocess.run([script], capture_output=True, text=True)
    assert usage.returncode == 2
    assert len(usage.stderr.splitlines()) == 1
    env = stand_in(tmp_path / "bin", "rawtherapee-cli", "", "picture")
    command = [script, str(tmp_path / "none.CRW"), str(tmp_path / "out.tif")]
    unreadable = subprocess.run(command, capture_output=True, text=True, env=env)
    assert (unreadable.returncode, unreadable.stderr) == (2, f"{tmp_path}/none.CRW: cannot be read\n")
    missing = subprocess.run(["/bin/sh", script, "a", "b"], capture_output=True, text=True, env={"PATH": "/nowhere"})
    assert missing.returncode == 2
    assert missing.stderr == "rawtherapee-cli is not installed\n"


@pytest.mark.slow
def test_a_kit_goes_where_a_link_leads(profile: CameraProfile, tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    assert write_kit(profile, SETTING, tmp_path / "link", "rawtherapee") == tmp_path / "link"
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / "develop.sh").is_file()
    (tmp_path / "dangling").symlink_to("later")
    write_kit(profile, SETTING, tmp_path / "dangling", "rawtherapee")
    assert (tmp_path / "later" / "develop.sh").is_file()


def stand_in(folder: Path, name: str, says: str, makes: str) -> dict[str, str]:
    """An environment in which a program is a script: what it says of a RAW file, and its picture."""
    folder.mkdir(exist_ok=True)
    (folder / "made").write_text(makes)
    script = (
        f'#!/bin/sh\necho "{says}" >&2\n'
        f'for word; do case "$word" in *developed.tif) cp "{folder}/made" "$word";; esac; done\n'
    )
    (folder / name).write_text(script)
    (folder / name).chmod(0o755)
    return {"PATH": f"{folder}:{os.environ['PATH']}"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("says", "makes", "code", "words"),
    [
        ("", "picture", 0, ""),
        ("[colorin] could not find requested profile", "picture", 1, "did not use the profile: [colorin] could"),
        ("module colorin version mismatch: history is 7", "picture", 1, "did not use the profile: module colorin"),
        ("", 'darktable:operation="agx"\n darktable:enabled="1"', 1, "it was asked not to: operation=.agx"),
        ("", 'darktable:operation="agx"\n darktable:enabled="0"', 0, ""),
        ("x\ncannot read the mosaic\ny", "", 1, "made no picture of it: cannot read the mosaic"),
    ],
)
def test_darktable_is_believed_only_where_it_used_the_profile_alone(
    says: str, makes: str, code: int, words: str, profile: CameraProfile, tmp_path: Path
) -> None:
    folder = write_kit(profile, SETTING, tmp_path / "kit", "darktable")
    (tmp_path / "a.CRW").write_bytes(b"raw")
    run = subprocess.run(
        [str(folder / "develop.sh"), "a.CRW", "out.tif"], capture_output=True, text=True, cwd=tmp_path,
        env=stand_in(tmp_path / "bin", "darktable-cli", says, makes),
    )  # fmt: skip
    assert run.returncode == code, run.stderr
    assert (tmp_path / "out.tif").exists() == (code == 0)
    assert len(run.stderr.splitlines()) == (1 if words else 0)
    assert re.search(words.replace("[", r"\["), run.stderr)


def test_a_camera_profile_is_a_format_of_bake(profile: CameraProfile, tmp_path: Path, lutforge: CommandLine) -> None:
    profile.save(tmp_path / "camera.npz")
    words = ("bake", "camera.npz", "render", "--to", SETTING, "-o", "look.dcp")
    run = lutforge(*words, "-o", "look.cube", "--size", "17", cwd=tmp_path)
    assert re.search(r"look.dcp.*\n.*ΔE00 mean 0\.[0-3]", run.stdout)
    lutforge(*words, "--for", "rawtherapee", cwd=tmp_path)
    x = np.random.default_rng(3).random((500, 3))
    mine, other = read_dcp(tmp_path / "look.dcp")(x), developed_by_dcp(dcp_tags(tmp_path / "look.dcp"), x)
    assert np.abs(mine - other).max() < 2e-3  # another implementation of the specification
    for command in ("check", "inspect"):
        shown = lutforge(command, "look.dcp", cwd=tmp_path)
        assert "Canon PowerShot S40 standard" in shown.stdout
        assert "holds     forward matrix, look table, tone curve" in shown.stdout
    for more, why in (
        (("--for", "darktable"), "darktable does not read .dcp"),
        (("--space", "acescg"), "a camera profile renders RAW"),
    ):
        assert why in lutforge(*words, *more, cwd=tmp_path, status=2).stderr
    lutforge("bake", "camera.npz", "linearize", "--from", SETTING, "-o", "a.dcp", cwd=tmp_path, status=2)


@pytest.mark.usefixtures("small_profiles")
def test_shots_of_a_shell_s_pattern_are_checked_and_those_of_the_calibration_marked(
    profile: CameraProfile, tmp_path: Path, lutforge: CommandLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The program itself is tried elsewhere."""
    known = profile.shots[0]

    def checked(folder: Path, shots: list[Path], progress: object) -> tuple[list[KitCheck], list[str]]:
        return [KitCheck(shot.name, 100, 1.0, 2.0, 3.0, 1.0, shot.stem == known) for shot in shots], []

    monkeypatch.setattr("lutforge.pipeline.kit_checks.check_kit", checked)
    profile.save(tmp_path / "camera.npz")
    words = ("kit", "camera.npz", "--to", SETTING, "-o", "kit", "--for", "DarkTable")
    run = lutforge(*words, "--check", f"{known}.CRW", "b.CRW", "c.CRW", cwd=tmp_path)
    marked = {line.split()[0]: line.split()[-1] for line in run.stdout.splitlines() if ".CRW " in line}
    assert marked == {f"{known}.CRW": "yes", "b.CRW": "no", "c.CRW": "no"}
    assert "flatter" in run.stderr and "check others" in run.stderr


@pytest.mark.usefixtures("small_profiles")
def test_kits_of_two_programs_without_a_named_folder_are_both_kept(
    profile: CameraProfile, tmp_path: Path, lutforge: CommandLine
) -> None:
    profile.save(tmp_path / "camera.npz")
    for program in ("OBS", "lightroom"):
        lutforge("kit", "camera.npz", "--to", SETTING, "--for", program, cwd=tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir() if path.is_dir()) == [
        "camera_lightroom_kit", "camera_obs_kit",
    ]  # fmt: skip


def test_a_kit_that_cannot_be_written_names_its_folder(profile: CameraProfile, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(b"not a folder")
    with pytest.raises(LutForgeError, match=r"file is a file, not a folder; choose another output folder"):
        write_kit(profile, SETTING, tmp_path / "file" / "kit", "rawtherapee")


def dcp_tags(path: Path) -> dict[int, Any]:
    """The tags of a DNG camera profile, which is a TIFF file but for its magic number."""
    data = path.read_bytes()
    assert data[:4] == b"IIRC"
    directory = ImageFileDirectory_v2(b"II*\0" + data[4:8])
    file = BytesIO(data)
    file.seek(directory.next)
    directory.load(file)
    return dict(directory)


def developed_by_dcp(tags: dict[int, Any], balanced: Array) -> Array:
    """What a DNG developer makes of balanced camera RGB (n, 3): encoded sRGB (DNG specification 1.7, chapter 6)."""
    forward, dims = np.asarray(tags[50964], dtype=np.float64).reshape(3, 3), np.asarray(tags[50981], dtype=int)
    curve = np.asarray(tags[50940]).reshape(-1, 2)
    hues, saturations, values = dims
    table = np.asarray(tags[50982]).reshape(values, hues, saturations, 3)
    to_xyz = np.array([[0.7976749, 0.1351917, 0.0313534], [0.2880402, 0.7118741, 0.0000857], [0.0, 0.0, 0.8252100]])
    rgb = np.clip(balanced @ (np.linalg.inv(to_xyz) @ forward).T, 0.0, 1.0)
    looked = _looked_up(rgb, table)
    order = np.argsort(looked, axis=1)
    low, middle, high = np.take_along_axis(looked, order, axis=1).T
    top, bottom = np.interp(high, *curve.T), np.interp(low, *curve.T)
    share = np.where(high > low, (middle - low) / np.where(high > low, high - low, 1.0), 0.0)
    toned = np.empty_like(looked)
    np.put_along_axis(toned, order, np.stack([bottom, bottom + share * (top - bottom), top], axis=1), axis=1)
    light = toned @ matrix_between("linear-prophoto", "linear-srgb").T
    return rgb_space("srgb").encode(np.clip(light, 0.0, 1.0))


def _looked_up(rgb: Array, table: Array) -> Array:
    """Colours (n, 3) through the look table, whose values are spaced and scaled behind sRGB's curve."""
    hue, saturation, value = rgb_to_hsv(rgb).T
    encoded, closed = rgb_space("srgb").encode(value), np.concatenate([table, table[:, :1]], axis=1)
    place = np.stack([encoded, hue, saturation]) * (np.array(closed.shape[:3])[:, None] - 1)
    turn, scale, lift = (map_coordinates(closed[..., c], place, order=1, mode="nearest") for c in range(3))
    lit = rgb_space("srgb").linearize(np.minimum(encoded * lift, 1.0))
    return np.asarray(hsv_to_rgb(np.stack([(hue + turn / 360) % 1, np.minimum(saturation * scale, 1.0), lit], axis=1)))
