"""Bad input gives one clear line on stderr and exit status 2, and leaves nothing half-written."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import PIL.Image
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.cli.bake import bake
from lutforge.cli.kit import kit
from lutforge.cli.main import main
from lutforge.cli.program_names import KIT_PROGRAMS, LUT_PROGRAMS
from lutforge.kits.all_kits import KITS
from lutforge.luts.lut_programs import PROGRAMS
from lutforge.pipeline.calibration import calibrate
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.dng import write_dng
from tests.cases.pictures import write_picture
from tests.cases.same_bytes import same_bytes
from tests.cases.samples import chart_140, made_samples, photograph_patches, spread_over_picture, with_gamma
from tests.conftest import CommandLine, Refused

HEADER = "camera,style,white_balance,shot,patch,exposure_s,raw_r,raw_g,raw_b,srgb_r,srgb_g,srgb_b\n"
ROW = "Test Cam,standard,daylight,a,p,0.01,{r},0.2,0.3,0.4,0.5,0.6\n"


def test_raw_files_that_are_none(refused: Refused, tmp_path: Path) -> None:
    (tmp_path / "empty.CR2").touch()
    (tmp_path / "text.CR2").write_text("this is not a photograph\n" * 100)
    assert "empty" in refused(tmp_path, "calibrate", "empty.CR2", "-o", "x.npz")
    assert "text.CR2" in refused(tmp_path, "calibrate", "text.CR2", "-o", "x.npz")
    assert "no such file" in refused(tmp_path, "sample", "missing.NEF", "-o", "x.csv")


def test_a_raw_without_preview_and_one_whose_jpeg_is_of_something_else(refused: Refused, tmp_path: Path) -> None:
    mosaic = np.random.default_rng(0).integers(600, 12000, (400, 600)).astype(np.uint16)
    write_dng(tmp_path / "alone.dng", mosaic)
    assert "no embedded preview" in refused(tmp_path, "calibrate", "alone.dng", "-o", "x.npz")
    noise = np.random.default_rng(1).integers(0, 256, (400, 600, 3), dtype=np.uint8)
    PIL.Image.fromarray(noise).save(tmp_path / "alone.JPG")
    assert "does not match" in refused(tmp_path, "calibrate", "alone.dng", "-o", "x.npz")


def small_table(path: Path) -> None:
    """60 samples of two shots."""
    made_samples(60, shots=("a", "b")).save(path)


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with samples and the profile made of them, to be copied."""
    folder = tmp_path_factory.mktemp("calibrated")
    small_table(folder / "samples.csv")
    calibrate(folder / "samples.csv", CalibrationOptions(size=5)).save(folder / "camera.npz")
    return folder


@pytest.fixture
def profile(calibrated: Path, tmp_path: Path) -> Path:
    """A folder with samples and the profile made of them."""
    return shutil.copytree(calibrated, tmp_path, dirs_exist_ok=True)


RENDER = ("bake", "camera.npz", "render", "--to", "standard/daylight")
REFINISH = ("bake", "camera.npz", "refinish", "--from", "standard/daylight", "--to", "standard/daylight")
MATCH = ("bake", "camera.npz", "match", "link.npz", *REFINISH[3:])


def test_settings_outputs_and_profiles(profile: Path, refused: Refused) -> None:
    before = (profile / "camera.npz").read_bytes()
    (profile / "link.npz").symlink_to("camera.npz")
    (profile / "file").touch()
    for value in ("0.1", "nan"):
        (profile / f"{value}.csv").write_text(HEADER + ROW.format(r=value))
    for words, says in (
        (("bake", "camera.npz", "render", "--to", "sepia/daylight", "-o", "x.cube"), "standard"),
        (("bake", "camera.npz", "render", "--to", "standard/moon", "-o", "x.cube"), "daylight"),
        (("bake", "camera.npz", "render", "--to", "standard/5200", "-o", "x.cube"), "5200K"),
        (("bake", "camera.npz", "render", "-o", "x.cube"), "--to"),
        (RENDER, "-o"),
        ((*RENDER, "-o", "x.png2"), "suffix"),
        ((*RENDER, "-o", "x.cube", "--size", "1"), "nodes"),
        ((*RENDER, "-o", "x.clf", "-o", "x.png", "--size", "33"), "x.png: 33 nodes"),
        ((*RENDER, "--space", "acescg", "-o", "x.clf", "-o", "x.3dl"), "x.3dl"),
        ((*RENDER, "--ev", "1", "-o", "x.cube"), "--ev"),
        ((*REFINISH, "--ev", "99", "-o", "x.cube"), "20 stops"),
        (("bake", "samples.csv", *RENDER[2:], "-o", "x.cube"), "not a LutForge profile"),
        (("calibrate", "samples.csv", "--size", "2", "-o", "y.npz"), "size"),
        (("calibrate", "nan.csv", "-o", "y.npz"), "line 2"),
        (("calibrate", "0.1.csv", "-o", "y.npz"), "at least"),
        (("calibrate", "samples.csv", "--preset", "magic", "-o", "y.npz"), "preset"),
        (("apply", "camera.npz", "none.jpg", "--from", "standard/daylight", "-o", "out"), "no such file"),
        (("apply", "none.cube", "none.jpg", "-o", "out"), "none.cube"),
        (("config", "samples.csv", "-o", "ocio"), "not a LutForge profile"),
        (("frobnicate",), "frobnicate"),
        (("bake",), "Missing"),
        # An output has the suffix of its kind.
        (("calibrate", "samples.csv", "-o", "samples.csv"), ".npz"),
        (("calibrate", "samples.csv", "-o", "camera"), ".npz"),
        (("sample", "samples.csv", "-o", "samples.xlsx"), ".csv or .npz"),
        (("report", "none.npz", "-o", "report.pdf"), ".html"),
        (("import-nus", "folder", "-o", "camera.json"), ".npz"),
        (("config", "camera.npz", "-o", "x.zip"), "a config is a folder that holds config.ocio, or an archive"),
        (("config", "camera.npz", "-o", "ocio/config.ocio"), "a config is a folder that holds config.ocio"),
        # One that is not named replaces no file.
        (("calibrate", "samples.csv"), "-o camera.npz to replace it"),
        (("response", "a.jpg"), "-o camera.npz to replace it"),
        (("import-nus", "folder"), "-o camera.npz to replace it"),
        (("sample", "a.dng"), "-o samples.csv to replace it"),
        # It is no input.
        ((*MATCH, "-o", "link.npz"), "replace an input"),
        (("config", "camera.npz", "-o", "camera.npz"), "is a file"),
        (("transfer", "samples.csv", "samples.csv", "-o", "samples.csv"), "suffix"),
        (("sample", "samples.csv", "-o", "samples.csv"), "replace an input"),
        # It is tried before the work.
        (("calibrate", "samples.csv", "-o", "file/camera.npz"), "file is a file"),
        (("sample", "missing.NEF", "-o", "file/s.csv"), "file is a file"),
        (("config", "missing.npz", "-o", "file/ocio"), "file is a file"),
        (("report", "missing.npz", "-o", "file/report.html"), "file is a file"),
        (("apply", "camera.npz", "missing.jpg", "-o", "file/out"), "file is a file"),
    ):
        assert says in refused(profile, *words), words
    assert same_bytes(profile / "camera.npz", before)


def test_half_of_a_lut_is_refused(lutforge: CommandLine, refused: Refused, profile: Path) -> None:
    made = lutforge(*RENDER, "-o", "look.spi3d", cwd=profile)
    error = float(re.findall(r"read back, against the model: mean ([0-9.e-]+)", made.stdout)[0])
    assert error < 1e-3  # of the shaper and the cube together
    assert "look.spi1d" in refused(profile, "apply", "look.spi3d", "a.jpg", "-o", "out")


def test_a_terminal_without_unicode_shows_question_marks() -> None:
    """As Windows' cp1252: the help holds arrows that it cannot show."""
    command, ascii_only = [sys.executable, "-m", "lutforge", "--help"], {**os.environ, "PYTHONIOENCODING": "ascii"}
    result = subprocess.run(command, env=ascii_only, capture_output=True)
    assert result.returncode == 0, result.stderr
    assert b"?" in result.stdout


def test_a_transfer_between_shots_of_different_things(refused: Refused, tmp_path: Path) -> None:
    for seed, name in ((5, "one"), (6, "other")):
        rng = np.random.default_rng(seed)
        (tmp_path / f"{name}.csv").write_text(
            HEADER + "".join(f"{name},standard,daylight,a,p{n},0.01,{r},{g},{b},{r},{g},{b}\n"
                             for n, (r, g, b) in enumerate(rng.uniform(0.05, 0.9, (60, 3)).round(4)))
        )  # fmt: skip
    assert "not of the same scenes" in refused(tmp_path, "transfer", "one.csv", "other.csv", "-o", "t.json")


def test_a_cube_of_footage_tells_how_bright_its_worst_light_is(lutforge: CommandLine, profile: Path) -> None:
    words = ("bake", "camera.npz", "render", "--to", "standard/daylight", "--space")
    message = lutforge(*words, "vlog", "--size", "9", "-o", "a.cube", "-o", "a.clf", cwd=profile).stderr
    (light,) = re.findall(r"a\.cube: the largest difference is at light (\d+) times as bright as white", message)
    assert 1 < int(light) <= 46  # where V-Log ends
    assert "a.clf: the largest" not in message


def test_the_command_alone_prints_its_help(lutforge: CommandLine) -> None:
    alone = lutforge()
    assert "calibrate" in alone.stdout
    assert alone.stderr == ""


def test_the_shell_completes_commands(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("_LUTFORGE_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", "lutforge cal")
    monkeypatch.setenv("COMP_CWORD", "1")
    monkeypatch.setattr(sys, "argv", ["lutforge"])
    with pytest.raises(SystemExit):
        main()
    assert "calibrate" in capsys.readouterr().out


def test_inspect_takes_folders_tables_profiles_luts_and_pictures(lutforge: CommandLine, profile: Path) -> None:
    write_picture(profile / "picture.jpg", (8, 8))
    lutforge("bake", "camera.npz", "render", "--to", "standard/daylight", "-o", "look.cube", cwd=profile)
    whole = lutforge("inspect", ".", cwd=profile)
    for words in ("60 samples", "Test Cam", "bake, config", "a finished picture"):
        assert words in whole.stdout
    assert "cube" in lutforge("inspect", "look.cube", cwd=profile).stdout
    (profile / "empty").mkdir()
    assert "in this folder" in lutforge("inspect", "empty", cwd=profile, status=2).stderr


def test_programs_are_named_in_any_case(lutforge: CommandLine, profile: Path) -> None:
    baked = lutforge("bake", "camera.npz", "refinish", "--from", "standard/daylight", "--to", "Standard/Daylight",
                     "--for", "Resolve", "--size", "5", cwd=profile)  # fmt: skip
    files = [line.partition(":")[0] for line in baked.stdout.splitlines() if not line.startswith(" ")]
    assert f"load {files[0]} in resolve" in baked.stderr
    words = ("linearize", "--from", "standard/daylight", "--space", "ACEScg", "-o", "linear.clf")
    lutforge("bake", "camera.npz", *words, cwd=profile)


def test_inspect_shows_what_a_camera_did_to_shots(lutforge: CommandLine, tmp_path: Path) -> None:
    samples = spread_over_picture(photograph_patches(nikon_d5100(), chart_140()[:60], stops=(-2, -1, 0)))
    calibrate(samples, CalibrationOptions(size=7)).save(tmp_path / "camera.npz")
    name = str(samples.shot[0])
    again = replace(with_gamma(samples, [name], 0.85), shot=np.char.add(samples.shot, " again"))
    again.save(tmp_path / "again.csv")
    shown = lutforge("inspect", "--scene", "camera.npz", "again.csv", cwd=tmp_path)
    lines = {line.split(" again")[0].strip(): line for line in shown.stdout.splitlines() if " again" in line}
    assert len(lines) == 15
    assert [shot for shot, line in lines.items() if "±" in line] == [name]
    replace(again, style=np.full(len(again), "sepia")).save(tmp_path / "other.csv")
    refusal = lutforge("inspect", "--scene", "camera.npz", "other.csv", cwd=tmp_path, status=2)
    assert "not in the profile" in refusal.stderr


def test_help_lists_every_program() -> None:
    """The lists stand in the help by hand, since what knows them takes a second to load."""
    for command, parameter, tables, listed in (
        (bake, "reader", PROGRAMS, LUT_PROGRAMS),
        (kit, "program", KITS, KIT_PROGRAMS),
    ):
        option = get_args(inspect.signature(command, eval_str=True).parameters[parameter].annotation)[-1]
        assert tuple(tables) == listed
        assert ", ".join(listed) in option.help


def test_a_terminal_gets_no_control_characters_of_a_file(lutforge: CommandLine, tmp_path: Path) -> None:
    table = tmp_path / "samples.csv"
    small_table(table)
    text = table.read_text().replace("Test Cam", "Cam\x1b]0;x\x07\x9b2J").replace(",a,", ",\x1b[2Ja,")
    table.write_text(text, encoding="utf-8")
    shown = lutforge("inspect", "samples.csv", cwd=tmp_path)
    assert "Cam?]0;x??2J" in shown.stdout
    for words in (("samples.csv",), ("sam\x1b[2Jples.csv",), ("sam\x1b[2Jples.csv", "samples.csv")):
        output = lutforge("inspect", *words, cwd=tmp_path, status=2 * (words != ("samples.csv",)))
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", output.stdout + output.stderr), words


@pytest.mark.parametrize("name", ["look.json", "samples.tsv", "samples.xlsx"])
def test_files_with_neither_samples_nor_raw_are_told_what_does(refused: Refused, tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("camera\tstyle\n" * 20)
    for command in ("calibrate", "sample"):
        words = refused(tmp_path, command, name)
        assert "not a RAW file" in words and ".csv or .npz" in words and "damaged" not in words
