"""The OpenColorIO config of the installed Blender: .blend files name the colour spaces of this config."""

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path

_INSIDE = Path("datafiles", "colormanagement", "config.ocio")


def blender_config() -> Path | None:
    """Blender's own config: of the `blender` on the path, else the newest where systems install it, else none."""
    program = shutil.which("blender")
    candidates = [] if program is None else list(_configs_of(Path(program).resolve()))
    configs = [path for path in candidates if path.is_file()] or [path for path in _installed() if path.is_file()]
    return max(configs, key=_version, default=None)


def _configs_of(program: Path) -> Iterator[Path]:
    """Paths where a program's config may be: in its folder, in an application of macOS, below a prefix of Linux."""
    folder = program.parent
    for root in (folder, folder.parent / "Resources", folder.parent / "share" / "blender"):
        yield root / _INSIDE
        yield from root.glob(f"[0-9]*/{_INSIDE.as_posix()}")


def _installed() -> Iterator[Path]:
    """Paths where the config of a Blender in the usual folders of the systems may be."""
    for program in ("/Applications/Blender.app/Contents/MacOS/Blender", "/snap/blender/current/blender"):
        yield from _configs_of(Path(program))
    programs = Path(os.environ.get("PROGRAMFILES", "C:/Program Files"), "Blender Foundation")
    for folder in programs.glob("Blender *"):
        yield from _configs_of(folder / "blender.exe")


def _version(path: Path) -> tuple[int, ...]:
    """The version number in the path, the last one where there are several; () without one."""
    numbers = re.findall(r"(?<=[/\\ ])(\d+)\.(\d+)(?=[/\\])", str(path))
    return tuple(map(int, numbers[-1])) if numbers else ()
