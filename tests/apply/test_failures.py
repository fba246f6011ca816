"""Whatever is wrong with one image of a batch is told in one line, and the others are graded."""

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses
import pytest

from lutforge.apply.grade import ConfigRecipe
from lutforge.errors import ConfigError, ImageError
from lutforge.images.read import ImageReader
from lutforge.ocio.config import write_config
from tests.cases.pictures import write_cube, write_picture
from tests.cases.profiles import small_profile
from tests.ocio.test_config import SMALL

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def run(folder: Path, lutforge: Run) -> Run:
    """`lutforge apply` in the folder."""
    return partial(lutforge, "apply", cwd=folder)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_cube(tmp_path / "look.cube")
    write_picture(tmp_path / "good.png", (90, 120), seed=1)
    write_picture(tmp_path / "good.tif", (90, 120), "uint16", seed=2)
    return tmp_path


def test_each_failure_is_named_and_nothing_is_lost(folder: Path, run: Run) -> None:
    data = (folder / "good.png").read_bytes()
    (folder / "cut.png").write_bytes(data[:-3000])
    broken = bytearray(data)
    broken[-2000] ^= 255
    (folder / "broken.png").write_bytes(broken)  # libpng says so on stderr by itself
    (folder / "zero.jpg").touch()
    (folder / "text.exr").write_text("hello")
    (folder / "folder.tif").mkdir()
    write_picture(folder / "folder.tif" / "inside.jpg")
    write_picture(folder / "grey.tif", channels=1)
    bad = ("cut.png", "broken.png", "zero.jpg", "text.exr", "none.exr", "grey.tif")
    done = run("look.cube", "good.png", *bad, "good.tif", "folder.tif", "./good.png", "-o", "out", "--json")
    assert done.returncode == 1
    summary = json.loads(done.stdout)
    assert [entry["output"] for entry in summary["graded"]] == ["out/good.png", "out/good.tif", "out/inside.jpg"]
    assert {entry["source"] for entry in summary["failed"]} == set(bad)
    assert "red, green and blue; this image has 1 channel" in done.stderr
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note: ")]
    assert len(lines) == 6
    assert all(line.startswith("lutforge: ") for line in lines), lines
    assert "note: good.png: given twice; graded once" in done.stderr
    assert "3 graded, 0 skipped, 6 failed" in done.stderr
    assert [path.name for path in (folder / "out").glob(".*")] == [".lutforge-apply.jsonl"]


def test_a_full_disk(folder: Path) -> None:
    """A limit of the size of a file stands for it. One process for all formats: libjpeg would end it."""
    write_picture(folder / "large.png", (300, 400), seed=3)
    code = """if True:
        import resource
        from pathlib import Path
        from lutforge.apply.batch import apply_batch
        from lutforge.apply.grade import LutRecipe
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        for suffix in ("jpg", "png", "tif", "exr", "webp", "bmp", "dpx", "tga", "sgi", "ppm", "hdr", "jp2"):
            result = apply_batch(LutRecipe(Path("look.cube")), ["large.png", "none.png"], "out", suffix)
            print(suffix, len(result.done), *(failure.reason for failure in result.failed), sep="|")
        """
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=100, check=False
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 12
    for line in lines:
        suffix, count, *reasons = line.split("|")
        assert count == "0"
        assert reasons[0].startswith(f"out/large.{suffix}: "), reasons
        assert reasons[1:] == ["none.png: no such file"]
    assert not (folder / "out").exists()


def test_missing_frames_are_failures_where_they_were_asked_for(folder: Path, run: Run) -> None:
    for number in (1001, 1002, 1004):
        write_picture(folder / f"shot.{number}.exr", (20, 30), "half")
    done = run("look.cube", "shot.1001-1004####.exr", "-o", "out")
    assert done.returncode == 1
    assert "lutforge: shot.1003.exr: this frame is missing" in done.stderr
    assert done.stdout.split() == [f"out/shot.{number}.exr" for number in (1001, 1002, 1004)]
    again = run("look.cube", "shot.####.exr", "-o", "out", "--resume")
    assert again.returncode == 0
    assert "not there: frame 1003" in again.stderr
    assert "0 graded, 3 skipped" in again.stderr


# --- Files of strangers that made `apply` hang or end in a traceback: each is one line of our own error --------------


@pytest.mark.slow
def test_a_config_that_names_an_endless_lut_is_refused(tmp_path: Path) -> None:
    path = write_config([small_profile()], tmp_path / "config", inverse_size=SMALL)
    (path.parent / "luts" / "endless.csp").write_text("CSPLUTV100\n3D\n\nBEGIN METADATA\nx\n")
    path.write_text(path.read_text().replace("test_one_standard_linearize.clf", "endless.csp"))
    with pytest.raises(ConfigError, match=r"config\.ocio: .*seconds"):
        ConfigRecipe(path, "Test One standard daylight", "ACEScg").check()


def test_an_exr_whose_attributes_are_no_text_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    oiio.ImageBuf(np.full((4, 4, 3), 0.5, np.float32)).write(str(path))
    path.write_bytes(path.read_bytes().replace(b"chlist\0", b"\xff\xfelist\0"))
    with pytest.raises(ImageError, match=r"a\.exr: cannot be read as an image \(it holds bytes that are not text\)"):
        ImageReader(path)
