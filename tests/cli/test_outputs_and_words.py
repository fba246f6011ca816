"""What the commands write is refused before the work where it cannot be, and their words are forgiving."""

import inspect
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from lutforge.calibration.options import CalibrationOptions
from lutforge.cli.bake import PROGRAMS as LISTED
from lutforge.cli.kit import kit
from lutforge.cli.main import main
from lutforge.luts.programs import PROGRAMS
from lutforge.pipeline.calibration import calibrate
from lutforge.pipeline.kits import KITS
from lutforge.samples.table import write_samples
from lutforge.simulate.camera import nikon_d5100
from tests.cases.pictures import write_picture
from tests.cases.samples import chart_140, photograph_patches, spread_over_picture, with_gamma
from tests.cli.test_bad_input import Refused, profile, refused, small_table
from tests.conftest import CommandLine

__all__ = ["profile", "refused"]


def test_a_cube_of_footage_tells_how_bright_its_worst_light_is(lutforge: CommandLine, profile: Path) -> None:
    words = ("bake", "camera.npz", "render", "--to", "standard/daylight", "--space")
    said = lutforge(*words, "vlog", "--size", "9", "-o", "a.cube", "-o", "a.clf", cwd=profile).stderr
    (light,) = re.findall(r"a\.cube: the largest difference is at light (\d+) times as bright as white", said)
    assert 1 < int(light) <= 46  # where V-Log ends
    assert "a.clf: the largest" not in said


def test_the_command_alone_prints_its_help(lutforge: CommandLine) -> None:
    alone = lutforge()
    assert alone.returncode == 0
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
    baked = lutforge("bake", "camera.npz", "render", "--to", "standard/daylight", "-o", "look.cube", cwd=profile)
    assert baked.returncode == 0, baked.stderr
    whole = lutforge("inspect", ".", cwd=profile)
    assert whole.returncode == 0, whole.stderr
    for words in ("60 samples", "Test Cam", "bake, config", "a finished picture"):
        assert words in whole.stdout
    assert "cube" in lutforge("inspect", "look.cube", cwd=profile).stdout
    (profile / "empty").mkdir()
    assert "in this folder" in lutforge("inspect", "empty", cwd=profile).stderr


def test_programs_are_listed_and_named_in_any_case(lutforge: CommandLine, profile: Path) -> None:
    assert list(PROGRAMS) == LISTED.split(", ")
    baked = lutforge("bake", "camera.npz", "refinish", "--from", "standard/daylight", "--to", "Standard/Daylight",
                     "--for", "Resolve", "--size", "5", cwd=profile)  # fmt: skip
    assert baked.returncode == 0, baked.stderr
    files = [line.partition(":")[0] for line in baked.stdout.splitlines() if not line.startswith(" ")]
    assert f"load {files[0]} in resolve" in baked.stderr
    linear = lutforge("bake", "camera.npz", "linearize", "--from", "standard/daylight", "--space", "ACEScg",
                      "-o", "linear.clf", cwd=profile)  # fmt: skip
    assert linear.returncode == 0, linear.stderr


def test_inspect_shows_what_a_camera_did_to_shots(lutforge: CommandLine, tmp_path: Path) -> None:
    samples = spread_over_picture(photograph_patches(nikon_d5100(), chart_140()[:60], stops=(-2, -1, 0)))
    calibrate(samples, CalibrationOptions(size=7)).save(tmp_path / "camera.npz")
    name = str(samples.shot[0])
    again = replace(with_gamma(samples, [name], 0.85), shot=np.char.add(samples.shot, " again"))
    write_samples(tmp_path / "again.csv", again)
    shown = lutforge("inspect", "--scene", "camera.npz", "again.csv", cwd=tmp_path)
    assert shown.returncode == 0, shown.stderr
    lines = {line.split(" again")[0].strip(): line for line in shown.stdout.splitlines() if " again" in line}
    assert len(lines) == 15
    assert [shot for shot, line in lines.items() if "±" in line] == [name]
    write_samples(tmp_path / "other.csv", replace(again, style=np.full(len(again), "sepia")))
    refusal = lutforge("inspect", "--scene", "camera.npz", "other.csv", cwd=tmp_path)
    assert refusal.returncode == 2 and "not in the profile" in refusal.stderr


def test_help_lists_every_program() -> None:
    """The lists stand in the help by hand, since what knows them takes a second to load."""
    parameters = inspect.signature(kit, eval_str=True).parameters
    told = get_args(parameters["program"].annotation)
    assert set(KITS) <= set(re.findall(r"\w+", told[-1].help))


def test_a_terminal_gets_no_control_characters_of_a_file(lutforge: CommandLine, tmp_path: Path) -> None:
    small_table(tmp_path / "samples.csv")
    text = (
        (tmp_path / "samples.csv").read_text().replace("Test Cam", "Cam\x1b]0;x\x07\x9b2J").replace(",a,", ",\x1b[2Ja,")
    )
    (tmp_path / "samples.csv").write_text(text, encoding="utf-8")
    shown = lutforge("inspect", "samples.csv", cwd=tmp_path)
    assert "Cam?]0;x??2J" in shown.stdout
    for words in (("samples.csv",), ("sam\x1b[2Jples.csv",), ("sam\x1b[2Jples.csv", "samples.csv")):
        told = lutforge("inspect", *words, cwd=tmp_path)
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", told.stdout + told.stderr), words


@pytest.mark.parametrize("name", ["look.json", "samples.tsv", "samples.xlsx"])
def test_files_that_hold_neither_samples_nor_raw_are_told_what_does(
    refused: Refused, tmp_path: Path, name: str
) -> None:
    (tmp_path / name).write_text("camera\tstyle\n" * 20)
    for command in ("calibrate", "sample"):
        said = refused(tmp_path, command, name)
        assert "not a RAW file" in said and ".csv or .npz" in said and "damaged" not in said
