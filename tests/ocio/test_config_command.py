"""`lutforge config` as users type it."""

import subprocess
import sys
from pathlib import Path

import pytest

from lutforge.ocio.check import load_config
from tests.cases.profiles import plain_profile


def lutforge(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "lutforge", "config", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.slow
def test_versions_merging_and_folders_in_use(tmp_path: Path) -> None:
    profile = tmp_path / "camera.npz"
    plain_profile("Nikon D40").save(profile)
    made = lutforge(profile, "-o", tmp_path / "ocio", "--ocio-version", "2.3")
    assert made.returncode == 0, made.stderr
    assert "no interop IDs (2.5)" in made.stderr
    assert "profile version 2.3, checked: " in made.stdout and "input colour spaces" in made.stdout
    assert len(made.stdout.splitlines()) == 1  # counts: names of a hundred spaces would hide the notes
    assert load_config(tmp_path / "ocio" / "config.ocio").getMinorVersion() == 3
    again = lutforge(profile, "-o", tmp_path / "ocio")
    assert again.returncode == 2
    assert len(again.stderr.strip().splitlines()) == 1
    assert "--replace" in again.stderr
    assert lutforge(profile, "-o", tmp_path / "ocio", "--replace").returncode == 0
    merged = lutforge(profile, "-o", tmp_path / "all.ocioz", "--merge", tmp_path / "ocio" / "config.ocio")
    assert merged.returncode == 0, merged.stderr
    spaces = load_config(tmp_path / "all.ocioz").getColorSpaceNames()
    assert any("Nikon D40 2 standard daylight" in name for name in spaces)
    for wrong in (("--merge", "nothing.ocio"), ("--ocio-version", "3.0"), (profile,)):
        failed = lutforge(profile, "-o", tmp_path / "other", *wrong)
        assert failed.returncode == 2, wrong
        assert len(failed.stderr.strip().splitlines()) == 1, failed.stderr
        assert not (tmp_path / "other").exists()
