"""Compiled kernels are kept in the user's cache folder; without such a folder all works."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lutforge import __version__
from tests.cases.real_data import S40

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
    print(sum(twice.dispatcher().stats.cache_misses.values()))
'''

NOWHERE = {"HOME": os.devnull, "XDG_CACHE_HOME": f"{os.devnull}/cache", "LOCALAPPDATA": f"{os.devnull}\\cache"}
"""A user whose folders cannot be made, not even by root."""


def run(environment: dict[str, str], *words: object) -> subprocess.CompletedProcess[str]:
    kept = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME")}
    kept["PYTHONPATH"] = str(Path(__file__).parents[1])
    command = [sys.executable, *map(str, words)]
    return subprocess.run(command, env=kept | environment, capture_output=True, text=True, timeout=300)


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


ROOT = Path(__file__).parents[1]

AS_ON_WINDOWS = '''"""Import every module of LutForge without what Windows lacks, and run the command line."""

import importlib
import os
import pkgutil
import signal
import sys

import lutforge.compiled  # numba and the standard library look at their system before anything is hidden
import multiprocessing, subprocess, tempfile, asyncio, socketserver

for name in ("fork", "killpg", "sysconf", "register_at_fork", "sched_getaffinity", "getuid", "geteuid", "setsid"):
    if hasattr(os, name):
        delattr(os, name)
for name in ("SIGKILL", "SIGHUP", "SIGALRM"):
    if hasattr(signal, name):
        delattr(signal, name)
for name in ("resource", "fcntl", "pwd", "grp", "termios"):
    sys.modules[name] = None

for module in sorted(found.name for found in pkgutil.walk_packages(lutforge.__path__, "lutforge.")):
    if not module.endswith("__main__"):
        importlib.import_module(module)

from lutforge.cli.main import main

sys.argv = ["lutforge", "--help"]
main()
'''


def python(*words: object, **settings: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *map(str, words)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TERM": "dumb", **settings}
    return subprocess.run(command, capture_output=True, text=True, timeout=300, env=environment)


@pytest.mark.slow
def test_every_module_imports_where_windows_has_less() -> None:
    ran = python("-c", AS_ON_WINDOWS)
    assert ran.returncode == 0, ran.stderr[-2000:]
    assert "calibrate" in ran.stdout


@pytest.mark.slow
def test_a_wheel_in_an_environment_of_its_own_calibrates_and_bakes(tmp_path: Path) -> None:
    """Nothing but the wheel and what it asks for, and no folder of the repository on the path."""
    built = python("-m", "pip", "wheel", "--no-deps", "--quiet", "--wheel-dir", tmp_path, ROOT)
    assert built.returncode == 0, built.stderr
    wheel = next(tmp_path.glob("lutforge-*.whl"))
    assert python("-m", "venv", tmp_path / "env").returncode == 0
    tools = tmp_path / "env" / ("Scripts" if sys.platform == "win32" else "bin")

    def run(*words: object) -> str:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        command = [str(tools / str(words[0])), *map(str, words[1:])]
        ran = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=900)
        assert ran.returncode == 0, ran.stderr
        return ran.stdout

    run("python", "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel)
    assert run("lutforge", "--version").split()[-1] == wheel.name.split("-")[1]
    run("python", "-c", "from importlib.resources import files; assert (files('lutforge') / 'py.typed').is_file()")
    run("lutforge", "calibrate", S40, "-o", "camera.npz", "--size", 9)
    run("lutforge", "bake", "camera.npz", "render", "--to", "standard/auto", "-o", "render.cube")
    assert (tmp_path / "render.cube").stat().st_size > 0
    inside = [path for path in (tmp_path / "env").rglob("*.nbi") if "lutforge" in path.parts]
    assert not inside, "compiled kernels beside the package outlive its removal"
