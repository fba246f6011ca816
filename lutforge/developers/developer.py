"""What all RAW developers have in common: a neutral development of a RAW file as a linear picture."""

import os
import re
import shutil
import subprocess
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge import child_processes
from lutforge.arrays import Pixels
from lutforge.atomic_write import scratch_folder
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ShotError, one_line
from lutforge.images.development import Development
from lutforge.images.read import read_image

TIMEOUT_S = 600
"""A development that takes longer than this is given up: programs wait for a screen that is not there."""


@dataclass(frozen=True)
class Developer(ABC):
    """A program that develops RAW files from the command line.

    name: that `--developer` takes; program: the executable; space: the linear colour space of what `develop` gives, by
    its name in `lutforge.colour.rgb_spaces`; install: how to get it, in one line.
    """

    name: str
    program: str
    space: str
    install: str

    @abstractmethod
    def command(self, raw: Path, output: Path, folder: Path) -> list[str]:
        """The command that develops `raw` to a 16-bit TIFF, neutrally; `folder` is for its own files."""

    def objection(self, output: Path) -> str:
        """Say why a TIFF of `command` is not neutral, as other versions' may be; "" where it is."""
        return ""

    def linear(self, pixels: Pixels) -> Pixels:
        """Pixels of the TIFF → linear RGB of `space`."""
        return pixels


def develop(developer: Developer, raw: Path) -> Development:
    """Develop a RAW file neutrally. Raises ShotError where the program is missing, or makes no picture of the file."""
    version = program_version(developer)
    with scratch_folder() as folder:
        output = folder / "developed.tif"
        run_command(developer.command(raw.resolve(), output, folder), developer.name, raw, output)
        objection = developer.objection(output)
        if objection:
            raise ShotError(f"{raw}: {version} did not develop it neutrally: {objection}; use another version of it")
        pixels = read_image(output).pixels
    return Development(developer.linear(_colour(pixels, raw)), developer.space, version)


def read_developed(path: Path, space: str) -> Development:
    """Read a picture that any program developed: 16-bit TIFF or EXR, encoded in `space`.

    Raises ImageError where it cannot be read, SettingsError on an unknown space.
    """
    encoding = rgb_space(space)
    pixels = encoding.decode(_colour(read_image(path).pixels, path)).astype(np.float32)
    return Development(pixels, encoding.linear.name, f"pictures in {encoding.name}")


def run_command(command: Sequence[str], name: str, raw: Path, output: Path) -> str:
    """Run a command that develops `raw`, and require that it made `output`; return what it wrote to standard error.

    name: of the program, for people. Raises ShotError with the line in which the program says why.
    """
    # Without a display variable no program waits for a window.
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    try:
        run = child_processes.run(command, TIMEOUT_S, environment)
    except subprocess.TimeoutExpired:
        raise ShotError(f"{raw}: {name} did not finish within {TIMEOUT_S // 60} minutes") from None
    except OSError as error:
        raise ShotError(f"{command[0]} cannot be run ({error.strerror or error})") from None
    if not output.is_file() or output.stat().st_size == 0:
        lines = [line for line in (run.stderr or run.stdout).splitlines() if line.strip()]
        telling = [line for line in lines if re.search("fail|error|cannot|unsupported|mismatch", line, re.IGNORECASE)]
        said = one_line((telling or lines[-1:] or ["it gave no reason"])[0].removeprefix(f"{raw}: "), 200)
        raise ShotError(f"{raw}: {name} made no picture of it: {said}")
    return run.stderr


def program_version(developer: Developer) -> str:
    """The name and version of the installed program. Raises ShotError, with how to install it, where there is none."""
    if shutil.which(developer.program) is None:
        raise ShotError(
            f"{developer.program} is not installed, which --developer {developer.name} runs: {developer.install}"
        )
    try:
        run = child_processes.run([developer.program, "--version"], 60)
    except (OSError, subprocess.TimeoutExpired):
        raise ShotError(f"{developer.program} cannot be run: {developer.install}") from None
    found = re.search(r"\d+(?:\.\d+)+", run.stdout + run.stderr)
    return f"{developer.name} {found[0]}" if found else developer.name


def _colour(pixels: Pixels, path: Path) -> Pixels:
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ShotError(f"{path}: its development is not a colour picture")
    return np.asarray(pixels[..., :3], dtype=np.float32)
