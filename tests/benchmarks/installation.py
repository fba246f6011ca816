"""How much LutForge installs, and how long `make` takes to install and to test.

    python -m tests.benchmarks.installation [--only WORD …] [--json FILE]

Installs into environments of its own, from the package index.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

from tests.benchmarks import common
from tests.benchmarks.common import ROOT, Figure, Figures, Parts


def megabytes(folder: Path) -> float:
    """What the files below a folder take."""
    return sum(path.lstat().st_size for path in folder.rglob("*") if not path.is_dir()) / 1e6


def installed(folder: Path, name: str, extras: str) -> Figures:
    """The size of a new environment with LutForge, and the seconds that it takes to make."""
    began = time.perf_counter()
    subprocess.run([sys.executable, "-m", "venv", str(folder / name)], check=True)
    pip = [str(folder / name / ("Scripts" if os.name == "nt" else "bin") / "python"), "-m", "pip"]
    words = [
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "-c",
        str(ROOT / "constraints.txt"),
        f"{ROOT}{extras}",
    ]
    subprocess.run([*pip, *words], check=True)
    yield Figure(f"installation{extras}", megabytes(folder / name), unit="MB", compared=False)
    yield Figure(f"installation{extras}: seconds", time.perf_counter() - began, unit="s", compared=False)


def tested() -> Figures:
    """The seconds of the quick tests."""
    began = time.perf_counter()
    subprocess.run(["make", "test"], cwd=ROOT, check=True)
    yield Figure("make test: minutes", (time.perf_counter() - began) / 60, unit="min", compared=False)


def parts(folder: Path) -> Parts:
    """What is measured, by name."""
    return {
        "alone": lambda: installed(folder, "alone", ""),
        "extras": lambda: installed(folder, "extras", "[studio,chart,heif]"),
        "dev": lambda: installed(folder, "dev", "[dev]"),
        "tests": tested,
    }


if __name__ == "__main__":
    sys.exit(common.measured(parts, common.parser(__doc__).parse_args()))
