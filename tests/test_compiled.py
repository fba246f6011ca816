"""Compiled kernels are kept in the user's cache folder; without such a folder all works."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lutforge import __version__

KERNEL = '''"""A kernel in a module of its own."""

import numba

from lutforge.compiled import compiled


@compiled(fastmath={"contract"})
def once(x: float) -> float:
    return x


@compiled(fastmath={"contract"})
def twice(x: float) -> float:
    return once(x) + x


if __name__ == "__main__":
    assert twice(21.0) == 42.0
    assert not numba.config.CACHE_DIR
    print(sum(twice.made().stats.cache_misses.values()))
'''

NOWHERE = {"HOME": os.devnull, "XDG_CACHE_HOME": f"{os.devnull}/cache", "LOCALAPPDATA": f"{os.devnull}\\cache"}
"""A user whose folders cannot be made, not even by root."""


def run(environment: dict[str, str], *words: object) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    kept["PYTHONPATH"] = str(Path(__file__).parents[1])
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=kept | environment, capture_output=True, text=True, timeout=300, check=False)


@pytest.fixture
def script(tmp_path: Path) -> Path:
    (tmp_path / "source").mkdir()
    path = tmp_path / "source" / "kernel.py"
    path.write_text(KERNEL, encoding="utf-8")
    return path


@pytest.mark.skipif(sys.platform != "linux", reason="names Linux's cache folder")
def test_machine_code_is_kept_in_the_users_cache_folder_and_nowhere_else(script: Path, tmp_path: Path) -> None:
    for compiled_anew in ("1", "0"):
        ran = run({"XDG_CACHE_HOME": str(tmp_path / "cache")}, script)
        assert ran.returncode == 0, ran.stderr
        assert ran.stdout.strip() == compiled_anew
    assert len(list((tmp_path / "cache" / "lutforge" / __version__).rglob("*.nbi"))) == 2
    assert len(list(tmp_path.rglob("*.nbi"))) == 2


def test_without_a_folder_that_can_be_written_kernels_still_run(script: Path) -> None:
    ran = run(NOWHERE, script)
    assert ran.returncode == 0, ran.stderr
    ran = run(NOWHERE, "-c", KERNEL)  # of no file at all
    assert ran.returncode == 0, ran.stderr


def test_commands_run_without_a_folder_that_can_be_written() -> None:
    ran = run(NOWHERE, "-B", "-m", "lutforge", "--version")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert __version__ in ran.stdout
