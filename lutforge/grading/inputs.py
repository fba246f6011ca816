"""The images that a batch grades: files, and the images of folders."""

import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import ImageError
from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.shots.discover import RAW_SUFFIXES

BATCH_JOURNAL = ".lutforge-apply.jsonl"
"""The file in the output folder that records graded images: one JSON object per line; of several the last counts."""


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and the reason, in one line."""

    source: Path
    reason: str


def find_inputs(words: Sequence[Path], output: Path, raw: bool = False) -> tuple[list[Path], list[str]]:
    """The images of files and folders, in order, and notes on those that are left out.

    Those of a folder are sorted by name; the output folder is refused. raw: RAW files count as images, unless their
    folder has a picture of the same name, which is the same photograph. Raises ImageError.
    """
    images: list[Path] = []
    notes: list[str] = []
    for word in words:
        if not word.is_dir():
            images.append(word)
            continue
        if word.resolve() == output.resolve():
            raise ImageError(f"{word}: the graded images go into this folder; choose another output folder")
        in_folder, left_out = _in_folder(word, raw)
        notes += left_out
        if not in_folder:
            raise ImageError(f"{word}: no image in this folder")
        images += in_folder

    # A file that is named twice for one output is graded once; links with other names count as other images.
    first: dict[tuple[Path, str], Path] = {}
    resolved = resolver()
    repeated = [path for path in images if first.setdefault((resolved(path), path.name), path) is not path]
    notes += [f"{path}: given twice; graded once" for path in dict.fromkeys(repeated)]
    return list(first.values()), notes


def resolver() -> Callable[[Path], Path]:
    """A function that resolves paths as `Path.resolve` does, but resolves a folder of thousands of files only once."""
    folder = cache(Path.resolve)

    def resolved(path: Path) -> Path:
        linked = os.path.islink(path)  # noqa: PTH114 - Path.is_symlink raises where the folder may not be read
        if linked:
            with suppress(RuntimeError, OSError):  # a link that leads to itself; the reader of the file reports it
                return path.resolve()
        place: Path = folder(path.parent) / path.name
        return place

    return resolved


def is_picture(path: Path) -> bool:
    """True where the suffix is that of an image file."""
    return path.suffix.lower() in _suffixes() | RAW_SUFFIXES


def _in_folder(folder: Path, raw: bool) -> tuple[list[Path], list[str]]:
    """The images of a folder by name, including links to files, and notes on those that are left out."""
    suffixes = _suffixes() | (RAW_SUFFIXES if raw else frozenset())
    try:
        entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        reason = f"the folder cannot be read ({error.strerror})"
        raise ImageError(f"{folder}: {reason}; name the files to grade") from error
    paths = [path for path in entries if path.suffix.lower() in suffixes and not path.is_dir()]
    pictures = {path.stem.lower() for path in paths if path.suffix.lower() not in RAW_SUFFIXES}
    left_out = {path for path in paths if path.suffix.lower() in RAW_SUFFIXES and path.stem.lower() in pictures}
    notes = []
    if left_out:
        files = f"{len(left_out)} RAW file{'s' if len(left_out) > 1 else ''}"
        notes.append(f"{folder}: {files} left out beside pictures of the same name; to render them, name them")
    return [path for path in paths if path not in left_out], notes


@cache
def _suffixes() -> frozenset[str]:
    """The suffixes of pictures, in lower case: those of OpenImageIO's formats that are files, and of HEIF."""
    groups = (group.partition(":") for group in oiio.get_string_attribute("extension_list").split(";"))
    files = (suffixes.split(",") for name, _, suffixes in groups if name not in ("null", "term"))
    return frozenset(f".{suffix}" for suffixes in files for suffix in suffixes) | frozenset(HEIF_SUFFIXES)
