"""The error of one image of a batch is one line, and the others are graded."""

import json
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pytest

from tests.cases.pictures import write_cube, write_picture

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
    done = run("look.cube", "good.png", *bad, "good.tif", "folder.tif", "./good.png", "-o", "out", "--json", status=1)
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
        from lutforge.grading.batch import apply_batch
        from lutforge.grading.grade import LutRecipe
        resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
        for suffix in ("jpg", "png", "tif", "exr", "webp", "bmp", "dpx", "tga", "sgi", "ppm", "hdr", "jp2"):
            result = apply_batch(LutRecipe(Path("look.cube")), ["large.png", "none.png"], "out", suffix)
            print(suffix, len(result.done), *(failure.reason for failure in result.failed), sep="|")
        """
    done = subprocess.run([sys.executable, "-c", code], cwd=folder, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 12
    for line in lines:
        suffix, count, *reasons = line.split("|")
        assert count == "0"
        assert reasons[0].startswith(f"out/large.{suffix}: "), reasons
        assert reasons[1:] == ["none.png: no such file"]
    assert not (folder / "out").exists()
