"""Finds the OpenColorIO config of the Blender that is installed, in which its files name colour spaces."""

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

_INSIDE = Path("datafiles", "colormanagement", "config.ocio")


def blender_config() -> Path | None:
    """Blender's own config: of the `blender` on the path, else the newest where systems install it, else none."""
    program = shutil.which("blender")
    places = [] if program is None else list(_beside(Path(program).resolve()))
    found = [path for path in places if path.is_file()] or [path for path in _installed() if path.is_file()]
    return max(found, key=_version, default=None)


def _beside(program: Path) -> Iterator[Path]:
    """Where a program's config may be: beside it, in an application of macOS, below a prefix of Linux."""
    folder = program.parent
    for root in (folder, folder.parent / "Resources", folder.parent / "share" / "blender"):
        yield root / _INSIDE
        yield from root.glob(f"[0-9]*/{_INSIDE.as_posix()}")


def _installed() -> Iterator[Path]:
    for program in ("/Applications/Blender.app/Contents/MacOS/Blender", "/snap/blender/current/blender"):
        yield from _beside(Path(program))
    programs = Path(os.environ.get("PROGRAMFILES", "C:/Program Files"), "Blender Foundation")
    for folder in programs.glob("Blender *"):
        yield from _beside(folder / "blender.exe")


def _version(path: Path) -> tuple[int, ...]:
    """The version that a folder of the path names, the last one; () without."""
    numbers = re.findall(r"(?<=[/\\ ])(\d+)\.(\d+)(?=[/\\])", str(path))
    return tuple(map(int, numbers[-1])) if numbers else ()
