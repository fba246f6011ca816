"""Bad input gives one clear line on stderr and exit status 2, and leaves nothing half-written."""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Protocol

import numpy as np
import OpenImageIO
import pytest

from lutforge.samples.table import write_samples
from lutforge.simulate.dng import write_dng
from tests.cases.samples import made_samples
from tests.conftest import CommandLine

HEADER = "camera,style,white_balance,shot,patch,exposure_s,raw_r,raw_g,raw_b,srgb_r,srgb_g,srgb_b\n"
ROW = "Test Cam,standard,daylight,a,p,0.01,{r},0.2,0.3,0.4,0.5,0.6\n"


class Refused(Protocol):
    """What the fixture `refused` gives."""

    def __call__(self, folder: Path, *words: object) -> str: ...


@pytest.fixture
def refused(lutforge: CommandLine) -> Refused:
    """Runs a command; expects status 2, one line, no traceback, and no new file in the folder. Returns the line."""

    def run(folder: Path, *words: object) -> str:
        before = sorted(folder.rglob("*"))
        result = lutforge(*words, cwd=folder)
        assert result.returncode == 2, (result.returncode, result.stdout, result.stderr)
        lines = result.stderr.strip().splitlines()
        assert len(lines) == 1, result.stderr
        assert lines[0].startswith("lutforge: ")
        assert sorted(folder.rglob("*")) == before
        return lines[0]

    return run


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
    other = OpenImageIO.ImageBuf(OpenImageIO.ImageSpec(600, 400, 3, OpenImageIO.UINT8))
    other.set_pixels(
        OpenImageIO.ROI(0, 600, 0, 400, 0, 1, 0, 3), np.random.default_rng(1).random((400, 600, 3), np.float32)
    )
    assert other.write(str(tmp_path / "alone.JPG"))
    assert "does not match" in refused(tmp_path, "calibrate", "alone.dng", "-o", "x.npz")


@pytest.mark.parametrize("name", ["Canon_G1_bayer4.crw", "Nikon_D1_RAW_NIKON_D1.NEF", "DC0008L.KDC"])
def test_unusual_raw_files(refused: Refused, shared_data: Path, tmp_path: Path, name: str) -> None:
    assert name in refused(tmp_path, "calibrate", shared_data / "unusual_raw" / name, "-o", "x.npz")


def small_table(path: Path) -> None:
    """60 samples of two shots."""
    write_samples(path, made_samples(60, shots=("a", "b")))


@pytest.fixture
def profile(lutforge: CommandLine, tmp_path: Path) -> Path:
    """A folder with samples and the profile made of them."""
    small_table(tmp_path / "samples.csv")
    made = lutforge("calibrate", "samples.csv", "-o", "camera.npz", "--size", "5", "--preset", "thesis", cwd=tmp_path)
    assert made.returncode == 0, made.stderr
    return tmp_path


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
        (("config", "camera.npz", "-o", "x.ocio"), "a config is a folder that holds config.ocio, or an archive"),
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
    assert (profile / "camera.npz").read_bytes() == before


def test_half_of_a_lut_is_refused(lutforge: CommandLine, refused: Refused, profile: Path) -> None:
    made = lutforge(*RENDER, "-o", "look.spi3d", cwd=profile)
    assert made.returncode == 0, made.stderr
    error = float(re.findall(r"read back, against the model: mean ([0-9.e-]+)", made.stdout)[0])
    assert error < 1e-3  # of the shaper and the cube together
    assert "look.spi1d" in refused(profile, "apply", "look.spi3d", "a.jpg", "-o", "out")


def test_a_terminal_without_unicode_shows_question_marks() -> None:
    """As Windows' cp1252: the help holds arrows that it cannot show."""
    result = subprocess.run(
        [sys.executable, "-m", "lutforge", "--help"],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        check=False,
    )
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
