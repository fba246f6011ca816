"""Compiled kernels are kept in the user's cache folder, never beside the sources; without such a folder all works."""

import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from lutforge import __version__
from tests.real_data import S40

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

CALIBRATION = f"""
from numba.core import event
import lutforge

class Listener(event.Listener):
    def on_start(self, event):
        print(event.data["dispatcher"])

    def on_end(self, event):
        pass

with event.install_listener("numba:compile", Listener()):
    lutforge.calibrate({str(S40)!r})
print("compiled")
"""
"""Prints what numba compiles, and "compiled" at the end."""

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


def test_processes_that_need_a_kernel_at_the_same_time_compile_it_once(script: Path, tmp_path: Path) -> None:
    steps = "    x += np.sort(np.array([x, x]))[0] - x\n" * 20  # take a second to compile
    slow = KERNEL.replace("    return", f"{steps}    return").replace(
        "import numba", "import numba\nimport numpy as np"
    )
    script.write_text(slow, encoding="utf-8")
    counting = """
import os, sys, time
from pathlib import Path
from kernel import twice

made, folder = twice.made(), Path(sys.argv[1])
(folder / f"{os.getpid()}.ready").touch()
while len(list(folder.glob("*.ready"))) < 3:
    time.sleep(0.001)
assert twice(21.0) == 42.0
print(sum(made.stats.cache_misses.values()))
"""
    (script.parent / "counting.py").write_text(counting, encoding="utf-8")
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    with ThreadPoolExecutor(3) as pool:
        running = [pool.submit(run, cache, script.parent / "counting.py", tmp_path) for _ in range(3)]
        compiled = [int(ran.result().stdout or -1) for ran in running]
    assert sorted(compiled) == [0, 0, 1]


@pytest.mark.slow
def test_what_compiles_ahead_compiles_all_that_a_calibration_needs(tmp_path: Path) -> None:
    cache = {"XDG_CACHE_HOME": str(tmp_path / "cache")}
    ahead = run(cache, "-m", "lutforge.pipeline.kernels")
    assert ahead.returncode == 0, ahead.stderr
    ran = run(cache, "-c", CALIBRATION)
    assert ran.stdout.split() == ["compiled"], ran.stderr


def test_without_a_folder_that_can_be_written_kernels_still_run(script: Path) -> None:
    ran = run(NOWHERE, script)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip() == "None"
    assert not list(script.parent.rglob("*.nbi"))


def test_commands_run_without_a_folder_that_can_be_written() -> None:
    ran = run(NOWHERE, "-B", "-m", "lutforge", "--version")
    assert (ran.returncode, ran.stderr) == (0, "")
    assert __version__ in ran.stdout
