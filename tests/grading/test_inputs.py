"""Files and folders become a list of images, and a batch of them goes on where it was stopped."""

import os
import random
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import distributed
import pytest

from lutforge.errors import ImageError
from lutforge.grading.batch import BatchResult, apply_batch, plan_jobs
from lutforge.grading.grade import LutRecipe
from lutforge.grading.inputs import BATCH_JOURNAL, find_inputs
from tests.cases.pictures import write_cube, write_picture


def test_what_is_in_a_folder_is_graded_but_for_what_is_hidden(tmp_path: Path) -> None:
    for name in ("a.JPG", "b.txt", ".hidden.jpg", "take #2.png", "sub/c.tif", "folder.png/d.tif"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).touch()
    named = [tmp_path / "none.png", tmp_path / "take #2.png"]  # reading the first will say that it is not there
    images, notes = find_inputs([tmp_path, *named], tmp_path / "out")
    assert [path.name for path in images] == ["a.JPG", "take #2.png", "none.png"]
    assert notes == [f"{named[1]}: given twice; graded once"]
    with pytest.raises(ImageError, match="choose another output folder"):
        find_inputs([tmp_path / "sub" / ".."], tmp_path)
    with pytest.raises(ImageError, match="no image in this folder"):
        (tmp_path / "empty").mkdir()
        find_inputs([tmp_path / "empty"], tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="links want rights there")
def test_links_of_files_and_folders_are_followed_where_an_output_would_replace_an_input(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "in" / "a.png").touch()
    (tmp_path / "folder").symlink_to("in")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "a.png").symlink_to(tmp_path / "in" / "a.png")
    for folder in ("in", "folder", "out"):
        with pytest.raises(ImageError, match="the output would replace an input"):
            plan_jobs([tmp_path / "in" / "a.png"], tmp_path / folder)


MOMENTS = int(os.environ.get("LUTFORGE_KILL_MOMENTS", "3"))
"""How many runs are killed; the longer proof sets 20."""


@pytest.fixture
def pictures(tmp_path: Path) -> list[Path]:
    """Formats that OpenImageIO dates, compresses, or tiles."""
    names = ("a.tif", "b.png", "c.jpg", "d.exr")
    (tmp_path / "in").mkdir()
    for seed, name in enumerate(names):
        write_picture(tmp_path / "in" / name, (50, 70), "half" if name == "d.exr" else "uint8", seed=seed)
    return [tmp_path / "in" / name for name in names]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != BATCH_JOURNAL}


def test_what_is_done_and_valid_is_skipped(tmp_path: Path, pictures: list[Path]) -> None:
    cube, out = write_cube(tmp_path / "look.cube"), tmp_path / "out"

    def run() -> BatchResult:
        return apply_batch(LutRecipe(cube), pictures, out, resume=True)

    def graded(result: BatchResult) -> list[str]:
        assert not result.failed
        return [done.target.name for done in result.done]

    everything = [path.name for path in pictures]
    assert graded(run()) == everything
    first = contents(out)
    result = run()
    assert (graded(result), [path.name for path in result.skipped]) == ([], everything)
    (out / "a.tif").write_bytes(first["a.tif"][:-1])  # cut short
    changed = bytearray(first["b.png"])
    changed[-20] ^= 1
    (out / "b.png").write_bytes(changed)  # damaged, with its size
    os.utime(out / "c.jpg")  # the same content, copied
    (out / "d.exr").unlink()
    assert graded(run()) == ["a.tif", "b.png", "d.exr"]
    assert contents(out) == first
    write_picture(pictures[2], (50, 70), seed=9)  # another picture under the same name
    assert graded(run()) == ["c.jpg"]
    write_cube(cube, 0.7)
    assert graded(run()) == everything
    assert contents(out)["a.tif"] != first["a.tif"]
    assert graded(apply_batch(LutRecipe(cube), pictures, out)) == everything  # not asked to resume


def test_a_damaged_journal_costs_time_only(tmp_path: Path, pictures: list[Path]) -> None:
    recipe, out = LutRecipe(write_cube(tmp_path / "look.cube")), tmp_path / "out"
    apply_batch(recipe, pictures, out)
    lines = (out / BATCH_JOURNAL).read_bytes().split(b"\n")
    (out / BATCH_JOURNAL).write_bytes(b"\xff{]\n[]\nnull\n" + b"[" * 100_000 + b"\n" + b"\n".join(lines[:-1])[:-40])
    result = apply_batch(recipe, pictures, out, resume=True)
    assert (len(result.done), len(result.skipped), result.failed) == (1, 3, ())
    assert len(apply_batch(recipe, pictures, out, resume=True).skipped) == 4


@pytest.mark.slow
def test_killed_runs_end_with_the_same_files(tmp_path: Path) -> None:
    """kill -9 at random moments: before, while and after images are written."""
    cube = write_cube(tmp_path / "look.cube")
    (tmp_path / "in").mkdir()
    pictures = []
    for seed in range(10):
        suffix = (".png", ".tif", ".jpg", ".exr")[seed % 4]
        pictures.append(tmp_path / "in" / f"{seed}{suffix}")
        write_picture(pictures[-1], (500, 700), "half" if suffix == ".exr" else "uint8", seed=seed)
    apply_batch(LutRecipe(cube), pictures, tmp_path / "undisturbed")
    out, rng = tmp_path / "out", random.Random(5)
    words = [sys.executable, "-m", "lutforge", "apply", str(cube), *map(str, pictures), "-o", str(out), "--resume"]
    killed = 0
    for _ in range(MOMENTS):
        present = {path.name for path in out.iterdir()} if out.exists() else set()
        process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        until = time.monotonic() + 60
        while process.poll() is None and time.monotonic() < until:
            if out.exists() and {path.name for path in out.iterdir()} - present:  # it has begun to write
                time.sleep(rng.uniform(0, 0.1))
                break
            time.sleep(0.002)
        process.send_signal(signal.SIGKILL)
        process.communicate()
        killed += process.returncode == -signal.SIGKILL
        if len(contents(out)) > 7:
            for path in rng.sample(sorted(out.iterdir()), 6):  # something is left to do for the next
                path.unlink()
    assert killed >= MOMENTS // 2
    last = subprocess.run(words, capture_output=True, text=True)
    assert last.returncode == 0, last.stderr
    assert contents(out) == contents(tmp_path / "undisturbed")


@pytest.mark.slow
def test_a_killed_worker_changes_nothing(tmp_path: Path) -> None:
    cube = write_cube(tmp_path / "look.cube")
    pictures = [tmp_path / f"{seed}.tif" for seed in range(16)]
    for seed, path in enumerate(pictures):
        write_picture(path, (300, 400), "uint16", seed=seed)
    (tmp_path / "zero.png").touch()
    here = apply_batch(LutRecipe(cube), pictures, tmp_path / "here")
    local_cluster: Any = distributed.LocalCluster
    with local_cluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, silence_logs=50
    ) as cluster:
        victim = next(iter(cluster.workers.values())).pid
        killed: list[int] = []

        def watch(what: str, share: float) -> None:
            if share >= 3 / 17 and not killed:
                killed.append(victim)
                os.kill(victim, signal.SIGKILL)

        batch = partial(apply_batch, LutRecipe(cube), folder=tmp_path / "there", scheduler=cluster.scheduler_address)
        there = batch([*pictures, tmp_path / "zero.png"], progress=watch)
        assert killed
        again = batch(pictures, resume=True)
    assert [failure.reason for failure in there.failed] == [f"{tmp_path / 'zero.png'}: the file is empty"]
    assert [done.source for done in there.done] == [done.source for done in here.done] == pictures
    assert contents(tmp_path / "there") == contents(tmp_path / "here")
    assert (len(again.done), len(again.skipped)) == (0, 16)
