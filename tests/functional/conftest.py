"""The demo, run once for all tests that look at what it makes."""

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """`lutforge demo` as a user runs it, with small lattices: the folder that it filled, and what it printed."""
    folder = tmp_path_factory.mktemp("demo")
    command = [sys.executable, "-m", "lutforge", "demo", "-o", str(folder), "--size", "17"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=540, check=False)
    assert run.returncode == 0, run.stderr
    return folder, run.stdout
