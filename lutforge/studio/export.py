"""Exports: the profile as it stands, and what the command line makes of it, by the command line itself."""

import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

from lutforge.errors import LutForgeError

Progress = Callable[[str, float], None]

LUT_SUFFIXES = (".clf", ".cube", ".resolve.cube", ".csp", ".3dl", ".png")
KINDS = ("render", "linearize", "refinish")
MOST_SECONDS = 1800


class ExportError(LutForgeError):
    """An export that the command line refused."""


def bake_command(profile: Path, kind: str, source: str, target: str, ev: float, output: Path) -> list[str]:
    """`lutforge bake` with the options that this kind of transform takes."""
    command = ["bake", str(profile), kind, "-o", str(output)]
    if kind in ("linearize", "refinish"):
        command += ["--from", source]
    if kind in ("render", "refinish"):
        command += ["--to", target]
    if kind == "refinish" and ev:
        command += ["--ev", f"{ev:g}"]
    return command


def config_command(profile: Path, output: Path) -> list[str]:
    """`lutforge config`."""
    return ["config", str(profile), "-o", str(output)]


def report_command(profile: Path, samples: Path | None, output: Path) -> list[str]:
    """`lutforge report`, with the samples where there are some."""
    return ["report", str(profile), *([] if samples is None else [str(samples)]), "-o", str(output)]


def as_text(command: list[str]) -> str:
    """The command as one would type it."""
    return shlex.join(["lutforge", *command])


def run(command: list[str], progress: Progress) -> tuple[str, ...]:
    """Run the command line; the lines that it printed. Raises ExportError with its own message."""
    progress(f"lutforge {command[0]}", 0.0)
    try:
        done = subprocess.run(
            [sys.executable, "-m", "lutforge", *command],
            capture_output=True, text=True, timeout=MOST_SECONDS, check=False, stdin=subprocess.DEVNULL,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ExportError(f"lutforge {command[0]}: stopped after {MOST_SECONDS} s") from None
    if done.returncode != 0:
        last = (done.stderr.strip().splitlines() or ["it failed"])[-1]
        raise ExportError(last.removeprefix("lutforge: "))
    return tuple(done.stdout.strip().splitlines())
