"""The shots among given files and folders, and the JPEG or RAW file that belongs to another file."""

import time
from collections.abc import Collection, Iterable, Mapping
from functools import lru_cache
from itertools import islice
from pathlib import Path

from lutforge.errors import ShotError
from lutforge.images.films import FILM_ADVICE, FILM_SUFFIXES
from lutforge.images.heif import HEIF_SUFFIXES, is_heif

RAW_SUFFIXES = frozenset(
    [
        ".3fr", ".ari", ".arw", ".bay", ".cap", ".cr2", ".cr3", ".crw", ".cs1", ".dc2", ".dcr", ".dng",
        ".drf", ".dsc", ".eip", ".erf", ".fff", ".gpr", ".iiq", ".k25", ".kc2", ".kdc", ".mdc", ".mef",
        ".mfw", ".mos", ".mrw", ".nef", ".nrw", ".obm", ".orf", ".ori", ".pef", ".ptx", ".pxn", ".qtk",
        ".r3d", ".raf", ".raw", ".rdc", ".rw2", ".rwl", ".rwz", ".sr2", ".srf", ".srw", ".sti", ".x3f",
    ]
)  # fmt: skip
"""Suffixes, in lower case, that a folder is searched for."""

JPEG_SUFFIXES = (".jpg", ".jpeg", ".jpe")

MAX_FILES = 100_000
"""RAW files that a folder may hold."""


def discover(paths: Iterable[Path | str]) -> list[Path]:
    """RAW files among files and folders, in the order given (inside a folder: by name, subfolders included), once each.

    A JPEG that belongs to a RAW file in its folder is left out. Any other named file is kept, whatever its suffix:
    reading it shows whether it is a shot. Raises ShotError: no such file or folder, or a folder without RAW files.
    """
    by_place: dict[Path, Path] = {}
    for path in map(Path, paths):
        if not path.exists():
            raise ShotError(f"{path}: no such file or folder")
        files = [path]
        if path.is_dir():
            named = (entry for entry in path.rglob("*") if entry.suffix.lower() in RAW_SUFFIXES)
            visible = (entry for entry in named if not entry.name.startswith(".") and entry.is_file())
            files = sorted(islice(visible, MAX_FILES + 1))
            if len(files) > MAX_FILES:
                raise ShotError(f"{path}: more than {MAX_FILES} RAW files; name a smaller folder")
            if not files:
                films = sorted(entry.name for entry in path.rglob("*") if entry.suffix.lower() in FILM_SUFFIXES)
                instead = f", but films, such as {films[0]}: {FILM_ADVICE}" if films else ""
                raise ShotError(f"{path}: the folder holds no RAW files{instead}")
        for file in files:
            if file.suffix.lower() not in (*JPEG_SUFFIXES, *HEIF_SUFFIXES) or raw_beside(file) is None:
                by_place.setdefault(file.resolve(), file)
    if not by_place:
        raise ShotError("no RAW files: name RAW files, or folders that hold some")
    return list(by_place.values())


def jpegs_of(path: Path) -> list[Path]:
    """A JPEG itself, or those of a folder by name. Raises ShotError where there is none."""
    if not path.is_dir():
        return [path]
    pictures = sorted(file for file in path.iterdir() if file.suffix.lower() in JPEG_SUFFIXES and file.is_file())
    if not pictures:
        raise ShotError(f"{path}: the folder holds no JPEGs")
    return pictures


def jpeg_beside(raw: Path) -> Path | None:
    """The JPEG of a RAW file's stem in its folder, in upper or lower case; None where there is none."""
    return next(iter(_of_stem(raw, JPEG_SUFFIXES)), None)


def picture_beside(raw: Path) -> Path | None:
    """The JPEG, else the HEIF, of a RAW file's stem in its folder, in upper or lower case; None where there is none."""
    return next(iter(_of_stem(raw, (*JPEG_SUFFIXES, *HEIF_SUFFIXES))), None)


def _of_stem(raw: Path, suffixes: Collection[str]) -> list[Path]:
    """The files with a RAW file's stem in its folder: its own upper and lower case first, and JPEG before HEIF."""
    try:
        files = sorted(entry for entry in raw.parent.iterdir() if entry.suffix.lower() in suffixes)
    except OSError:
        return []
    of_stem = [file for file in files if file.stem.lower() == raw.stem.lower()]
    return sorted(of_stem, key=lambda file: (file.stem != raw.stem, is_heif(file)))


def raw_beside(jpeg: Path) -> Path | None:
    """The RAW file of a JPEG's stem in its folder, in upper or lower case; None where there is none."""
    try:
        changed = jpeg.parent.stat().st_mtime_ns
        # A change within the last tick of the file system's clock may not show in that time yet.
        settled = time.time_ns() - changed > 10**9
        names = (_raw_names if settled else _raw_names.__wrapped__)(str(jpeg.parent), changed)
    except OSError:
        return None
    name = names.get(jpeg.stem.lower())
    return None if name is None else jpeg.with_name(name)


@lru_cache(maxsize=16)
def _raw_names(folder: str, changed: int) -> Mapping[str, str]:
    """The RAW files of a folder by their stems in lower case, the first of each by name."""
    files = sorted((path for path in Path(folder).iterdir() if path.suffix.lower() in RAW_SUFFIXES), reverse=True)
    return {path.stem.lower(): path.name for path in files}
