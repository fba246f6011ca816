"""Compiled kernels are kept in the user's cache folder, never beside the sources; without such a folder all works."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lutforge import __version__

KERNEL = '''"""A kernel in a module of its own."""

import numba

from lutforge.compiled import cache_folder, compiled


@compiled(fastmath={"contract"})
def twice(x: float) -> float:
    return 2 * x


if __name__ == "__main__":
    assert twice(21.0) == 42.0
    assert not numba.config.CACHE_DIR
    print(cache_folder())
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
    ran = run({"XDG_CACHE_HOME": str(tmp_path / "cache")}, script)
    assert ran.returncode == 0, ran.stderr
    folder = tmp_path / "cache" / "lutforge" / f"kernels-{__version__}"
    assert ran.stdout.strip() == str(folder)
    assert len(list(folder.rglob("*.nbi"))) == 1
    assert len(list(tmp_path.rglob("*.nbi"))) == 1


def test_machine_code_is_shared_by_copies_of_a_package_until_what_it_calls_changes(tmp_path: Path) -> None:
    cache, caller = {"XDG_CACHE_HOME": str(tmp_path / "cache")}, KERNEL.replace("return 2 * x", "return once(x) + x")
    for number, (place, once) in enumerate([("a", "x"), ("b", "x"), ("b", "x + 0.0 * x")]):
        (tmp_path / place).mkdir(exist_ok=True)
        called = KERNEL.replace("twice", "once").replace("return 2 * x", f"return {once}").split("if __name__")[0]
        (tmp_path / place / "called.py").write_text(called, encoding="utf-8")
        (tmp_path / place / "caller.py").write_text(f"from called import once\n{caller}", encoding="utf-8")
        ran = run(cache, tmp_path / place / "caller.py")
        assert ran.returncode == 0, ran.stderr
        assert len(list((tmp_path / "cache").rglob("*.nbi"))) == (4 if number == 2 else 2)


def test_without_a_folder_that_can_be_written_kernels_still_run(script: Path) -> None:
    ran = run(NOWHERE, script)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip() == "None"
    assert not list(script.parent.rglob("*.nbi"))


def test_commands_run_without_a_folder_that_can_be_written() -> None:
    ran = run(NOWHERE, "-B", "-m", "lutforge", "--version")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert __version__ in ran.stdout
