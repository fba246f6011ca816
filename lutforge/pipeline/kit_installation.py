"""Use case: a kit → its files where the program looks for them; and their removal."""

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path

from lutforge.errors import LutForgeError
from lutforge.kits.all_kits import KITS
from lutforge.kits.install import INSTALLED_KITS, install, is_installed, targets_of, uninstall
from lutforge.kits.manifest import MANIFEST, read_manifest
from lutforge.kits.places import Machine, place_of
from lutforge.pipeline.kits import kit_named


@dataclass(frozen=True)
class Installation:
    """The installation of a kit. files: where they are, or would be; use: what the user does in the program.

    found: the program is on this machine, so that the files were installed.
    """

    program: str
    files: tuple[Path, ...]
    found: bool
    use: str


def install_kit(folder: str | Path, into: str | Path | None = None) -> Installation:
    """Copy a kit to where its program looks for it. into: the program's folder of settings, if not the default.

    Where the program is not on this machine, nothing is written, and the result has the paths that would be. Raises
    LutForgeError where a file is there already that LutForge did not write.
    """
    kit = Path(folder)
    manifest = read_manifest(kit)
    program = str(manifest.get("program", ""))
    if program not in KITS:
        raise LutForgeError(f"{kit}: is no kit, or its {MANIFEST} is damaged: make it again")
    place = place_of(program, Machine(sys.platform, os.environ, Path.home()))
    if into is not None:
        if not Path(into).is_dir():
            raise LutForgeError(f"{into}: no such folder; --into names the folder where {program} keeps its settings")
        place = replace(place, settings=Path(into).resolve())
    targets = targets_of(program, kit, place, _data_folder() / "kits")
    is_found = not place.has_folder or is_installed(place)
    if is_found and targets:
        install(program, targets, _data_folder() / INSTALLED_KITS)
    return Installation(KITS[program].title, tuple(targets), is_found and bool(targets), place.use)


def uninstall_kit(program: str) -> tuple[list[Path], list[Path]]:
    """Remove a program's kits. Returns the files that were removed, and those that the user changed, which stay.

    Raises SettingsError on an unknown program, LutForgeError where nothing is installed for it.
    """
    return uninstall(kit_named(program), _data_folder() / INSTALLED_KITS)


def _data_folder() -> Path:
    """The folder where LutForge keeps files of this user."""
    import platformdirs  # imported here: only installations need it

    return platformdirs.user_data_path("lutforge", appauthor=False)
