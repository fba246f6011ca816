"""Ctrl-C at any moment: one line, within a second, nothing half-written, and no program left running."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from lutforge.grading.inputs import BATCH_JOURNAL
from lutforge.images.read import read_image
from lutforge.model.camera_profile import load_profile
from tests.cases.pictures import write_cube, write_picture

pytestmark = pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")

MOMENTS = (0.4, 0.9, 1.6, 2.5, 4.0)


def interrupted(folder: Path, seconds: float, *words: object, number: int = signal.SIGINT, **environment: str) -> bool:
    """Interrupt a command after so many seconds of its work, or five times as long where it waits for a program.

    Requires that it ends as it should; False where it was done before. The half second within which it ends is of its
    own work: other processes may keep it from its processor for longer.
    """
    with subprocess.Popen(
        [sys.executable, "-m", "lutforge", *map(str, words)], cwd=folder, stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2]), **environment},
    ) as run:  # fmt: skip
        process, until = psutil.Process(run.pid), time.monotonic() + 5 * seconds
        while run.poll() is None and sum(process.cpu_times()[:2]) < seconds and time.monotonic() < until:
            time.sleep(0.01)
        if run.poll() is not None:
            assert run.returncode == 0
            return False
        worked, began = process.cpu_times(), time.monotonic()
        run.send_signal(number)
        _, status, usage = os.wait4(run.pid, 0)
        took, run.returncode = time.monotonic() - began, os.waitstatus_to_exitcode(status)
        assert run.stderr is not None
        message = run.stderr.read().splitlines()
    if run.returncode == 0:  # the signal came when all was done
        return False
    assert run.returncode == -number
    assert message[-1] == "lutforge: stopped"
    assert usage.ru_utime + usage.ru_stime - worked.user - worked.system < 0.5
    assert took < 60.0  # it waits for none of the programs that it runs, which may take ten minutes
    assert not [
        other
        for other in psutil.process_iter()
        if _session(other.pid) == run.pid and other.status() != psutil.STATUS_ZOMBIE
    ], "a program is left running"
    assert not [path for path in folder.rglob("*") if ".lutforge-" in path.name and path.name != BATCH_JOURNAL]
    return True


def _session(process: int) -> int:
    try:
        return os.getsid(process)
    except ProcessLookupError:
        return 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("suffix", "sent"), [(".jpg", signal.SIGINT), (".tif", signal.SIGINT), (".tif", signal.SIGTERM)]
)
def test_grading_stops_at_once_and_leaves_whole_files(tmp_path: Path, suffix: str, sent: int) -> None:
    write_cube(tmp_path / "look.cube")
    write_picture(tmp_path / f"a{suffix}", (1500, 2000))
    for number in range(40):
        (tmp_path / f"b{number}{suffix}").hardlink_to(tmp_path / f"a{suffix}")
    pictures = [f"b{number}{suffix}" for number in range(40)]
    for seconds in MOMENTS:
        if not interrupted(tmp_path, seconds, "apply", "look.cube", *pictures, "-o", "out", number=sent):
            break
        for path in (tmp_path / "out").glob("*"):
            assert path.name == BATCH_JOURNAL or read_image(path).pixels.shape == (1500, 2000, 3)


def test_a_long_command_stops_at_once(tmp_path: Path) -> None:
    """The demo photographs, calibrates and bakes: whatever it is at after some seconds."""
    assert interrupted(tmp_path, 3.0, "demo", "-o", "demo")


@pytest.mark.slow
def test_fits_samples_configs_and_reports_stop_at_once(demo: tuple[Path, str], tmp_path: Path) -> None:
    shots, profile = sorted(demo[0].rglob("*.dng"))[:6], next(demo[0].rglob("*.npz"))
    commands: dict[str, tuple[object, ...]] = {
        "samples.csv": ("sample", *shots, "-o", "samples.csv"),
        "camera.npz": ("calibrate", *shots, "-o", "camera.npz"),
        "ocio": ("config", profile, "-o", "ocio"),
        "report.html": ("report", profile, "-o", "report.html"),
        "fix.cube": ("bake", profile, "linearize", "--from", "standard/daylight", "-o", "fix.cube"),
    }
    for output, words in commands.items():
        assert interrupted(tmp_path, MOMENTS[0], *words)
        assert not (tmp_path / output).exists()
        for seconds in MOMENTS[1:]:
            if not interrupted(tmp_path, seconds, *words):
                break
            # Between its last line of work and its end, a command may have written what it makes: whole then.
            if output == "camera.npz" and (tmp_path / output).exists():
                assert load_profile(tmp_path / output).styles


@pytest.mark.slow
def test_programs_that_it_runs_end_with_it(demo: tuple[Path, str], tmp_path: Path, shared_data: Path) -> None:
    """A developer that never ends, and that begins a program of its own, as the scripts of kits do."""
    program = tmp_path / "darktable-cli"
    program.write_text("#!/bin/sh\nsleep 600 & sleep 600\n")
    program.chmod(0o755)
    shot = next((shared_data / "canon_powershot_s40").glob("*.CRW"))
    path = f"{tmp_path}{os.pathsep}{os.environ['PATH']}"
    profile = next(demo[0].rglob("*.npz"))
    words = ("kit", profile, "--to", "standard", "--for", "darktable", "-o", "kit", "--check", shot)
    assert interrupted(tmp_path, 8.0, *words, PATH=path)
