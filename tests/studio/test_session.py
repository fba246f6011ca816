"""What a visitor may reach, and work in another process: cancelled at once, errors in one line."""

import os
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.studio.job_functions import broken, doubled, endless, killed, wrong
from tests.studio.shots_for_the_studio import chart_samples, photograph

pytest.importorskip("panel", reason="the studio needs Panel: pip install 'lutforge[studio]'")
from lutforge.apply.batch import apply_batch
from lutforge.apply.candidates import read_small
from lutforge.apply.profile_recipe import ProfileRecipe
from lutforge.calibration.options import CalibrationOptions
from lutforge.cli.main import app
from lutforge.images.read import read_image
from lutforge.images.write import write_image
from lutforge.model.camera_profile import CameraProfile, load_profile
from lutforge.pipeline.calibration import calibrate
from lutforge.studio.export import Export, run, wanted_lut
from lutforge.studio.export_view import ExportView
from lutforge.studio.folders import FolderError, Folders
from lutforge.studio.jobs import Job
from lutforge.studio.preview_view import Preview, PreviewView
from lutforge.studio.server import origins
from lutforge.studio.session import Session
from lutforge.studio.workspace import WorkspaceError


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


@pytest.fixture(scope="module")
def profile() -> CameraProfile:
    return calibrate(chart_samples(patches=45), CalibrationOptions(size=9))


def test_the_preview_is_what_apply_makes(profile: CameraProfile, tmp_path: Path) -> None:
    photograph(tmp_path / "picture.png", 120, 180)
    pixels = read_small(tmp_path / "picture.png", 2_100_000)
    assert pixels.shape == (120, 180, 3) and pixels.dtype == np.float32
    pixels[:20], pixels[20:25, :, 2] = 1.0, 1.0  # burnt out, and clipped in one channel
    write_image(tmp_path / "burnt.png", pixels, read_image(tmp_path / "picture.png"))
    profile.save(tmp_path / "camera.npz")
    for ev in (-0.7, 0.0, 0.7):
        shown = Preview(profile, read_small(tmp_path / "burnt.png", 2_100_000)).show(
            "standard/tungsten", "vivid/4500K+5", ev
        )
        recipe = ProfileRecipe((tmp_path / "camera.npz",), "standard/tungsten", "vivid/4500K+5", ev)
        apply_batch(recipe, [tmp_path / "burnt.png"], tmp_path / "out")
        applied = np.rint(read_image(tmp_path / "out" / "burnt.png").pixels * 255)
        assert np.abs(shown.pixels - applied).max() <= 1
        assert np.ptp(shown.pixels[0, 0].astype(int)) <= 12  # white stays white
    assert shown.histogram.sum(axis=0) == pytest.approx([1, 1, 1])
    marked = Preview(profile, pixels).show("standard/tungsten", "standard/daylight", ev=3.0, overlay=True)
    assert marked.clipped[0] > 0.05
    assert (marked.pixels == (230, 97, 1)).all(axis=2).mean() == pytest.approx(marked.clipped[0], abs=0.02)


def test_a_camera_without_raw_has_a_preview() -> None:
    samples = chart_samples(patches=120)
    reference = replace(samples, raw_camera=np.full(len(samples), "Reference"), wb=np.full((len(samples), 3), np.nan))
    profile = calibrate(reference, CalibrationOptions())
    pixels = np.random.default_rng(3).uniform(0.2, 0.8, (8, 8, 3)).astype(np.float32)
    balances = list(profile.white_balances)
    shown = Preview(profile, pixels).show(f"standard/{balances[0]}", f"standard/{balances[1]}", 0.3)
    exact = profile.refinish(f"standard/{balances[0]}", f"standard/{balances[1]}", 0.3)(pixels)
    assert np.abs(shown.pixels / 255 - exact).mean() < 0.01


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_exports_ask_before_they_replace_a_file(profile: CameraProfile, tmp_path: Path) -> None:
    session = Session(Folders.of([tmp_path]))
    session.loaded_profile = profile
    view = ExportView(session, PreviewView(session))
    (tmp_path / "camera.npz").write_text("another's")
    view.name.value = "camera"
    with pytest.raises(WorkspaceError, match="press again"):
        view._save_profile()
    assert (tmp_path / "camera.npz").read_text() == "another's"
    view._save_profile()
    assert load_profile(tmp_path / "camera.npz").camera == profile.camera
    view._save_profile()  # its own file


def test_an_export_is_the_command_that_it_tells(profile: CameraProfile, tmp_path: Path) -> None:
    profile.save(tmp_path / "camera.npz")
    wanted = wanted_lut("refinish", "standard/tungsten", "vivid/daylight", 0.8)
    export = Export("bake", tmp_path / "camera.npz", tmp_path / "mine.clf", wanted)
    lines = run(export, lambda what, share: None)
    assert "read back" in lines[0]
    words = shlex.split(str(export).replace("mine.clf", "theirs.clf"))
    result = CliRunner().invoke(app, words[1:])
    assert result.exit_code == 0, result.output
    assert (tmp_path / "mine.clf").read_bytes() == (tmp_path / "theirs.clf").read_bytes()


def test_large_photographs_are_averaged_down(tmp_path: Path) -> None:
    photograph(tmp_path / "large.png", 300, 400)
    small = read_small(tmp_path / "large.png", 20_000)
    whole = read_small(tmp_path / "large.png", 2_100_000)
    assert small.shape == (100, 133, 3)
    assert np.allclose(small[0, 0], whole[:3, :3].mean(axis=(0, 1)), atol=1e-5)


def test_only_pages_of_the_studio_itself_may_connect() -> None:
    assert origins("127.0.0.1", 5006) == ["127.0.0.1:5006", "localhost:5006"]
    assert origins("10.0.0.5", 80) == ["10.0.0.5:80"]


@pytest.mark.slow
def test_ctrl_c_ends_the_studio_without_a_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "lutforge", "studio", "--no-browser", "--port", "0", "--folder", str(tmp_path)]
    for early in (True, False):  # while the processes of its jobs start, and later
        with (tmp_path / "log").open("w") as log:
            server = subprocess.Popen(command, stdout=log, stderr=log, cwd=tmp_path, start_new_session=True)
            deadline = time.monotonic() + 120
            while "http://" not in (tmp_path / "log").read_text():
                assert server.poll() is None and time.monotonic() < deadline, (tmp_path / "log").read_text()
                time.sleep(0.05)
            time.sleep(0.3 if early else 8.0)
            os.killpg(server.pid, signal.SIGINT)  # as a terminal does: to every process of the group
            assert server.wait(60) in (0, 130)
        assert "Traceback" not in (tmp_path / "log").read_text()
