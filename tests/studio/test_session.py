"""What a visitor may reach, and work in another process: cancelled at once, errors in one line."""

import os
import time
from pathlib import Path

import numpy as np
import pytest

from tests.studio.job_functions import broken, doubled, endless, killed, wrong
from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from lutforge.calibration.options import CalibrationOptions
from lutforge.luts.steps import bake_steps
from lutforge.pipeline.calibration import calibrate
from lutforge.studio.folders import FolderError, Folders
from lutforge.studio.jobs import Job
from lutforge.studio.preview import Preview, read_preview
from lutforge.studio.server import origins


def test_no_path_leads_out_of_the_folders(tmp_path: Path) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside"
    inside.mkdir()
    outside.mkdir()
    (outside / "secret.csv").write_text("x")
    (inside / "link.csv").symlink_to(outside / "secret.csv")
    (inside / "folder").symlink_to(outside)
    (inside / "loop.csv").symlink_to(inside / "loop.csv")
    (inside / "mine.csv").write_text("x")
    folders = Folders.of([inside])
    assert folders.inside("mine.csv") == (inside / "mine.csv").resolve()
    assert folders.inside(str(inside / "new" / "file.npz")).name == "file.npz"
    for path in (
        "../../etc/passwd", "/etc/passwd", "../outside/secret.csv", "link.csv", "folder/secret.csv",
        "new/../../outside/x", "", "  ", "a\0b", "loop.csv/../../outside/x", "../inside2/x",
    ):  # fmt: skip
        with pytest.raises(FolderError) as error:
            folders.inside(path)
        assert "\n" not in str(error.value)
    assert folders.files([".csv"]) == ["mine.csv"]
    with pytest.raises(FolderError, match="not a folder"):
        Folders.of([inside / "mine.csv"])


def test_a_job_brings_its_result_or_one_line() -> None:
    jobs = [Job("doubling", doubled, 21), Job("a", wrong), Job("b", broken), Job("c", killed)]
    done, failed, raised, dead = (job.wait(120) for job in jobs)
    assert (done.state, done.result) == ("done", 42)
    assert (failed.state, failed.message) == ("failed", "two lines")
    assert raised.state == "failed" and "ZeroDivisionError: never" in raised.message
    assert dead.state == "failed" and "without a result" in dead.message


def test_cancelling_ends_the_process(tmp_path: Path) -> None:
    mark = tmp_path / "alive"
    job = Job("endless", endless, mark)
    deadline = time.monotonic() + 120
    while not mark.exists() or not mark.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.05)
    number = int(mark.read_text())
    job.cancel()
    assert job.wait(60).state == "cancelled"
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


def test_preview_is_what_the_model_says(tmp_path: Path) -> None:
    profile = calibrate(chart_samples(patches=45), CalibrationOptions(size=9))
    photograph(tmp_path / "picture.png", 120, 180)
    pixels = read_preview(tmp_path / "picture.png")
    assert pixels.shape == (120, 180, 3) and pixels.dtype == np.float32
    shown = Preview(profile, pixels).show("standard/tungsten", "vivid/4500K+5", ev=0.7)
    model = profile.refinish("standard/tungsten", "vivid/4500K+5", 0.7)
    exact = np.clip(bake_steps(model)(pixels.reshape(-1, 3)), 0, 1).reshape(pixels.shape)
    assert np.abs(shown.pixels / 255 - exact).max() < 1.5 / 255
    assert shown.histogram.sum(axis=0) == pytest.approx([1, 1, 1])
    marked = Preview(profile, pixels).show("standard/tungsten", "standard/daylight", ev=3.0, overlay=True)
    assert marked.clipped[0] > 0.05
    assert (marked.pixels == (230, 97, 1)).all(axis=2).mean() == pytest.approx(marked.clipped[0], abs=0.02)


def test_large_photographs_are_averaged_down(tmp_path: Path) -> None:
    photograph(tmp_path / "large.png", 300, 400)
    small = read_preview(tmp_path / "large.png", most=20_000)
    whole = read_preview(tmp_path / "large.png")
    assert small.shape == (100, 133, 3)
    assert np.allclose(small[0, 0], whole[:3, :3].mean(axis=(0, 1)), atol=1e-5)


def test_only_pages_of_the_studio_itself_may_connect() -> None:
    assert origins("127.0.0.1", 5006) == ["127.0.0.1:5006", "localhost:5006"]
    assert origins("10.0.0.5", 80) == ["10.0.0.5:80"]
