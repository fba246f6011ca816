"""Install a kit where its program looks for it, and remove it again.

A journal in the user's data folder names every file and folder that was made, with the SHA-256 of each file. It is
written before the files, so that they can be removed even when a run is killed. A file of the user is never replaced,
and an installed file that the user has changed is never removed.
"""

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from lutforge.atomic_write import atomic_path
from lutforge.boundary import reading, require_file
from lutforge.errors import LutForgeError
from lutforge.kits.places import Place

INSTALLED_KITS = "installed_kits.json"
MOST_JOURNAL = 4 << 20
"""Most bytes of a journal."""
NOT_INSTALLED = ("README.md", "kit.json", "develop.sh", "blender.sh")
"""Files of a kit that no program looks for."""


@dataclass(frozen=True)
class Installed:
    """The files installed for a program. files: SHA-256 by path; folders: those that were made, outer ones first."""

    files: dict[str, str] = field(default_factory=dict)
    folders: tuple[str, ...] = ()


def is_installed(place: Place) -> bool:
    """True where the program of a place is on this machine: it can be started, or its folder is there."""
    return any(shutil.which(command) for command in place.commands) or (
        place.settings is not None and place.settings.is_dir()
    )


def targets_of(program: str, kit: Path, place: Place, fallback: Path) -> dict[Path, Path]:
    """The kit's files, by the paths that they get. fallback: LutForge's folder, for programs that have none."""
    files = sorted(path for path in kit.iterdir() if path.is_file() and path.name not in NOT_INSTALLED)
    if not place.has_folder:
        return {fallback / program / file.name: file for file in files}
    settings = place.settings
    if settings is None:
        return {}
    targets = {
        settings / place.folders[file.suffix] / file.name: file for file in files if file.suffix in place.folders
    }
    for folder in place.whole:
        config = kit / "ocio"
        inside = sorted(path for path in config.rglob("*") if path.is_file())
        targets |= {settings / folder / path.relative_to(config): path for path in inside}
    return targets


def install(program: str, targets: Mapping[Path, Path], journal: Path) -> None:
    """Copy files to their targets, and record them in the journal. targets: the file that each path gets.

    Raises LutForgeError, before anything is written, where a file is there already that LutForge did not write.
    """
    installed = read_journal(journal)
    before = installed.get(program, Installed())
    missing: list[Path] = []
    for target in (*targets, journal):
        missing += [folder for folder in reversed(target.parents) if not folder.exists() and folder not in missing]
    for target in targets:
        if (target.exists() or target.is_symlink()) and before.files.get(str(target)) != _sum(target):
            raise LutForgeError(f"{target}: is there already, and not as LutForge wrote it; move it or rename it first")

    files = {**before.files, **{str(target): _sum(source) for target, source in targets.items()}}
    folders = tuple(sorted({*before.folders, *map(str, missing)}))  # each before those in it
    write_journal(journal, {**installed, program: Installed(files, folders)})
    for target, source in targets.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(target) as temporary:
            shutil.copyfile(source, temporary)


def uninstall(program: str, journal: Path) -> tuple[list[Path], list[Path]]:
    """Remove the files installed for a program. Returns those removed, and those that the user changed, which stay.

    Raises LutForgeError where nothing was installed for it.
    """
    installed = read_journal(journal)
    if program not in installed:
        names = ", ".join(installed) or "no program"
        raise LutForgeError(f"nothing is installed for {program}: {journal} names {names}")

    removed = []
    changed = []
    for name, digest in installed[program].files.items():
        path = Path(name)
        if not path.is_file():
            continue
        if _sum(path) == digest:
            path.unlink()
            removed.append(path)
        else:
            changed.append(path)

    of_other_programs = {name: entry for name, entry in installed.items() if name != program}
    write_journal(journal, of_other_programs)
    remaining = remove_empty(installed[program].folders)
    if of_other_programs and remaining:
        # Folders that hold files of other programs are handed on to one of these, and removed with the last of them.
        heir, entry = next(iter(of_other_programs.items()))
        folders = tuple(sorted({*remaining, *entry.folders}))
        write_journal(journal, {**of_other_programs, heir: Installed(entry.files, folders)})
    return removed, changed


def remove_empty(folders: Sequence[str]) -> list[str]:
    """Remove folders that are empty, the inner ones first. Returns those that remain."""
    remaining: list[str] = []
    for name in reversed(folders):
        folder = Path(name)
        if folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()
        elif folder.is_dir():
            remaining.insert(0, name)
    return remaining


def read_journal(journal: Path) -> dict[str, Installed]:
    """The installed files by program; empty where there is no journal. Raises LutForgeError on a damaged one."""
    if not journal.exists():
        return {}
    require_file(journal, "LutForge's list of installed kits", LutForgeError, MOST_JOURNAL)
    with reading(journal, "LutForge's list of installed kits", LutForgeError):
        stored = json.loads(journal.read_text(encoding="utf-8"))
        return {
            str(program): Installed(
                {str(path): str(digest) for path, digest in entry["files"].items()}, tuple(map(str, entry["folders"]))
            )
            for program, entry in stored.items()
        }


def write_journal(journal: Path, installed: Mapping[str, Installed]) -> None:
    """Write the journal of the installed files; where nothing is installed, delete it."""
    if not installed:
        journal.unlink(missing_ok=True)
        return
    entries = {name: {"files": entry.files, "folders": list(entry.folders)} for name, entry in installed.items()}
    with atomic_path(journal) as temporary:
        temporary.write_text(json.dumps(entries, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _sum(path: Path) -> str:
    """The SHA-256 of a file in hexadecimal digits; "" where it is none."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
