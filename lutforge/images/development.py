"""Pictures that a program developed from RAW files; calibration can use them instead of the RAW."""

import os
import re
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lutforge import child_processes
from lutforge.arrays import Pixels
from lutforge.colour.rgb_spaces import rgb_space
from lutforge.errors import ShotError, one_line
from lutforge.images.read import read_image

TIMEOUT_S = 600
"""A program that takes longer than this is given up: programs wait for a screen that is not there."""


@dataclass(frozen=True, eq=False)
class Development:
    """A white-balanced linear picture, in any of the four orientations.

    pixels: (h, w, 3) float32, linear RGB. space: a name of `lutforge.colour.rgb_spaces`, in which the picture was
    encoded: the pixels have its primaries. developer: what made it.
    """

    pixels: Pixels
    space: str
    developer: str


def read_developed(path: Path, space: str) -> Development:
    """Read a picture that any program developed: 16-bit TIFF or EXR, encoded in `space`.

    Raises ImageError where it cannot be read, ShotError where it has no colour, SettingsError on an unknown space.
    """
    encoding = rgb_space(space)
    pixels = read_image(path).pixels
    if pixels.ndim != 3 or pixels.shape[2] < 3:
        raise ShotError(f"{path}: its development is not a colour picture")
    linear = encoding.linearize(pixels[..., :3]).astype(np.float32)
    return Development(linear, encoding.name, f"pictures in {encoding.name}")


def run_command(command: Sequence[str], name: str, source: Path, output: Path) -> str:
    """Run a command that makes `output` of `source`, and require that it did; return what it wrote to standard error.

    name: of the program, for people. Raises ShotError with the line in which the program says why.
    """
    # Without a display variable no program waits for a window.
    environment = {key: value for key, value in os.environ.items() if key not in ("DISPLAY", "WAYLAND_DISPLAY")}
    try:
        run = child_processes.run(command, TIMEOUT_S, environment)
    except subprocess.TimeoutExpired:
        raise ShotError(f"{source}: {name} did not finish within {TIMEOUT_S // 60} minutes") from None
    except OSError as error:
        raise ShotError(f"{command[0]} cannot be run ({error.strerror or error})") from None
    if not output.is_file() or output.stat().st_size == 0:
        lines = [line for line in (run.stderr or run.stdout).splitlines() if line.strip()]
        telling = [line for line in lines if re.search("fail|error|cannot|unsupported|mismatch", line, re.IGNORECASE)]
        reason = one_line((telling or lines[-1:] or ["it gave no reason"])[0].removeprefix(f"{source}: "), 200)
        raise ShotError(f"{source}: {name} made no picture of it: {reason}")
    return run.stderr
