"""What a killed command leaves in the temporary directory, the next one takes away."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from lutforge.atomic_write import scratch_folder
from lutforge.simulate.camera import nikon_d5100
from lutforge.simulate.photograph import CameraSettings, photograph
from lutforge.simulate.scene import SCENES

CODE = """
import sys
from pathlib import Path
from lutforge.shots.read import read_shot
print("begun", flush=True)
while True:
    read_shot(Path(sys.argv[1]))
"""


@pytest.mark.slow
def test_shots_that_are_killed_leave_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    settings = CameraSettings(exposure_s=nikon_d5100().nominal_exposure_s, preview_scale=1.0)
    shot = photograph(nikon_d5100(), SCENES["still-life"](232, 344, 1), settings, tmp_path, "a", jpeg_beside=False)
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    environment = {**os.environ, "TMPDIR": str(scratch)}
    for number in range(40):
        command = [sys.executable, "-c", CODE, str(shot.dng)]
        with subprocess.Popen(command, env=environment, stdout=subprocess.PIPE) as run:
            assert run.stdout is not None and run.stdout.readline()
            time.sleep(0.013 * number)
            run.kill()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    with scratch_folder():
        pass
    assert list(scratch.iterdir()) == []
