"""Which images a batch grades: files, and the images of folders."""

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

JOURNAL = ".lutforge-apply.jsonl"
"""What a batch has done, in its output folder: one JSON object per line and graded image, the last one counts."""


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and why, in one line."""

    source: Path
    reason: str


def find_inputs(words: Sequence[Path], output: Path, raw: bool = False) -> tuple[list[Path], list[str]]:
    """The images that files and folders name, in order, and notes on what was left out.

    A folder gives the images in it, by name; one that the graded images go into is refused. raw: RAW files are images,
    save those beside a picture of the same name, which is the same photograph. Raises ImageError.
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
    again = [path for path in images if first.setdefault((resolved(path), path.name), path) is not path]
    notes += [f"{path}: given twice; graded once" for path in dict.fromkeys(again)]
    return list(first.values()), notes


def resolver() -> Callable[[Path], Path]:
    """A function that resolves paths as `Path.resolve`, but each folder once: it holds most of thousands of files."""
    folder = cache(Path.resolve)

    def resolved(path: Path) -> Path:
        linked = os.path.islink(path)  # noqa: PTH114 - Path.is_symlink raises where nothing may be read
        if linked:
            with suppress(RuntimeError, OSError):  # a link that leads to itself is no file, as its reader will say
                return path.resolve()
        place: Path = folder(path.parent) / path.name
        return place

    return resolved


def is_picture(path: Path) -> bool:
    """Whether the suffix is that of an image file."""
    return path.suffix.lower() in _suffixes() | RAW_SUFFIXES


def _in_folder(folder: Path, raw: bool) -> tuple[list[Path], list[str]]:
    """The images of a folder by name, links to files among them, and notes on what was left out."""
    suffixes = _suffixes() | (RAW_SUFFIXES if raw else frozenset())
    try:
        entries = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    except OSError as error:
        reason = f"the folder cannot be read ({error.strerror})"
        raise ImageError(f"{folder}: {reason}; name the files to grade") from error
    paths = [path for path in entries if path.suffix.lower() in suffixes and not path.is_dir()]
    pictures = {path.stem.lower() for path in paths if path.suffix.lower() not in RAW_SUFFIXES}
    beside = {path for path in paths if path.suffix.lower() in RAW_SUFFIXES and path.stem.lower() in pictures}
    notes = []
    if beside:
        files = f"{len(beside)} RAW file{'s' if len(beside) > 1 else ''}"
        notes.append(f"{folder}: {files} left out beside pictures of the same name; to render them, name them")
    return [path for path in paths if path not in beside], notes


@cache
def _suffixes() -> frozenset[str]:
    """The suffixes of finished pictures, in lower case: OpenImageIO's, but for those that are no files, and HEIF's."""
    groups = (group.partition(":") for group in oiio.get_string_attribute("extension_list").split(";"))
    files = (suffixes.split(",") for name, _, suffixes in groups if name not in ("null", "term"))
    return frozenset(f".{suffix}" for suffixes in files for suffix in suffixes) | frozenset(HEIF_SUFFIXES)
