"""Which images a batch grades, and where each goes: files, folders and frame sequences."""

import os
import re
from collections.abc import Container, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.apply import journal
from lutforge.errors import ImageError, SettingsError
from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.shots.discover import RAW_SUFFIXES

_PATTERN = re.compile(
    r"(?P<head>.*?)(?P<frames>\d+-\d+(?:x\d+)?(?:,\d+(?:-\d+(?:x\d+)?)?)*)?(?P<pad>#+|@+|%0?\d*d)(?P<tail>[^#@%]*)"
)
_NOT_FILES = frozenset({"null", "term"})
"""Formats of OpenImageIO whose suffixes are no image files."""


@dataclass(frozen=True)
class Input:
    """An image to grade. place: its name, with the folders to keep, below the output folder."""

    path: Path
    place: Path


@dataclass(frozen=True)
class Inputs:
    """What the words of a command name.

    missing: frames that were asked for by number and are not there; notes: gaps in sequences whose frames were not
    named, and what was left out of folders.
    """

    images: tuple[Input, ...]
    missing: tuple[Path, ...] = ()
    notes: tuple[str, ...] = ()


def find_inputs(
    words: Sequence[str | Path],
    frames: str | None = None,
    recursive: bool = False,
    leave_out: Sequence[Path] = (),
    raw: bool = False,
) -> Inputs:
    """The images that files, folders and sequences name, in order.

    A folder gives the images in it, by name; recursive: those of its subfolders too, which are kept in `place`, but
    not of `leave_out`, nor of folders that an earlier batch filled. raw: RAW files are images, save those beside a
    picture of the same name, which is the same photograph. A sequence is a name with #### (one # per digit; a single #
    is four), @@@@, %04d or %d in it, with the frames in front of that (shot.1001-1100####.exr, 1-9x2 for every second)
    or in `frames`; else those on the disk. A file of exactly that name comes first. Raises ImageError, SettingsError.
    """
    images: list[Input] = []
    missing: list[Path] = []
    notes: list[str] = []
    for word in map(Path, words):
        pattern = _PATTERN.fullmatch(word.name)
        if word.is_dir():
            found, left_out = _in_folder(word, recursive, leave_out, raw)
            notes += left_out
            if not found:
                raise ImageError(
                    f"{word}: no image in this folder" + ("" if recursive else "; --recursive looks deeper")
                )
            images += found
        elif pattern is None or word.exists():
            images.append(Input(word, Path(word.name)))
        elif (wanted := frames or pattern["frames"]) is not None:
            for number in parse_frames(wanted):
                path = word.with_name(frame_name(pattern, number))
                if path.exists():
                    images.append(Input(path, Path(path.name)))
                else:
                    missing.append(path)
        else:
            numbered = _on_disk(word, pattern)
            if not numbered:
                raise ImageError(f"{word}: no frame of this sequence is there")
            images += [Input(path, Path(path.name)) for path in numbered.values()]
            if gaps := _gaps(sorted(numbered)):
                notes.append(f"{word}: not there: frame {gaps}")
    return Inputs(tuple(images), tuple(missing), tuple(notes))


def parse_frames(text: str) -> list[int]:
    """Numbers of frames: "1001-1100", "1-9x2" (every second), "5", lists of those with commas. Raises SettingsError."""
    numbers: list[int] = []
    for part in text.split(","):
        match = re.fullmatch(r"\s*(\d{1,9})(?:-(\d{1,9})(?:x(\d{1,9}))?)?\s*", part)
        first, last, step = (int(match[1]), int(match[2] or match[1]), int(match[3] or 1)) if match else (0, -1, 1)
        if last < first or step < 1 or (last - first) // step + len(numbers) >= 10_000_000:
            raise SettingsError(f'"{text}": frames are written as 1001-1100, 1-9x2 (every second) or 1,5,9')
        numbers += range(first, last + 1, step)
    return numbers


def frame_name(pattern: re.Match[str], number: int) -> str:
    """The file name of a frame."""
    return f"{pattern['head']}{number:0{_digits(pattern['pad'])}d}{pattern['tail']}"


def _digits(pad: str) -> int:
    if pad.startswith("%"):
        return int(pad[1:-1] or 1)
    return 4 if pad == "#" else len(pad)


def _on_disk(word: Path, pattern: re.Match[str]) -> dict[int, Path]:
    """The frames of a sequence that exist, by number."""
    head, tail, digits = pattern["head"], pattern["tail"], _digits(pattern["pad"])
    numbered = {}
    if not word.parent.is_dir():
        raise ImageError(f"{word.parent}: no such folder")
    for path in word.parent.iterdir():
        name = path.name
        middle = name[len(head) : len(name) - len(tail)]
        if name.startswith(head) and name.endswith(tail) and middle.isascii() and middle.isdigit():
            exact = len(middle) == digits or (len(middle) > digits and middle[0] != "0")
            if exact and name == head + middle + tail:
                numbered[int(middle)] = path
    return dict(sorted(numbered.items()))


def _gaps(numbers: Sequence[int]) -> str:
    """The numbers missing between the first and the last, as "1005, 1010-1012"."""
    gaps = []
    for before, after in pairwise(numbers):
        if after - before == 2:
            gaps.append(str(before + 1))
        elif after - before > 2:
            gaps.append(f"{before + 1}-{after - 1}")
    return ", ".join(gaps)


def is_picture(path: Path) -> bool:
    """Whether the suffix is that of an image file."""
    return path.suffix.lower() in _suffixes() | frozenset(HEIF_SUFFIXES) | RAW_SUFFIXES


def _in_folder(folder: Path, recursive: bool, leave_out: Sequence[Path], raw: bool) -> tuple[list[Input], list[str]]:
    """The images of a folder by name, and notes on what was left out.

    Links to files are images, those to folders are not followed.
    """
    suffixes = _suffixes() | frozenset(HEIF_SUFFIXES) | (RAW_SUFFIXES if raw else frozenset())
    excluded = {path.resolve() for path in leave_out}
    found: list[Input] = []
    notes: list[str] = []
    negatives = 0
    if excluded & {folder.resolve(), *folder.resolve().parents}:
        raise ImageError(f"{folder}: the graded images go into this folder; choose another output folder")
    for place, subfolders, names in os.walk(folder, onerror=_refuse):
        at = Path(place)
        kept = sorted(name for name in names if not name.startswith(".") and Path(name).suffix.lower() in suffixes)
        pictures = {Path(name).stem.lower() for name in kept if not _is_raw(name)}
        positives = [name for name in kept if not _is_raw(name) or Path(name).stem.lower() not in pictures]
        negatives += len(kept) - len(positives)
        found += [Input(at / name, (at / name).relative_to(folder)) for name in positives]
        followed = [name for name in subfolders if recursive and not name.startswith(".")]
        subfolders[:] = [name for name in followed if not _is_output(at / name, excluded)]
        notes += [
            f"{at / name}: left out, it was graded into; name it to grade what is in it"
            for name in sorted(set(followed) - set(subfolders))
            if (at / name).resolve() not in excluded
        ]
    if negatives:
        notes.append(
            f"{folder}: {negatives} RAW file{'s' if negatives > 1 else ''} left out beside pictures of the same name; "
            "to render them, name them"
        )
    return sorted(found, key=lambda image: image.path), notes


def _is_output(folder: Path, excluded: Container[Path]) -> bool:
    written = os.path.exists(folder / journal.NAME)  # noqa: PTH110 - Path.exists raises where nothing may be read
    return written or folder.resolve() in excluded


def _refuse(failure: OSError) -> None:
    raise ImageError(f"{failure.filename}: the folder cannot be read ({failure.strerror}); name the folders to grade")


def _is_raw(name: str) -> bool:
    return Path(name).suffix.lower() in RAW_SUFFIXES


@cache
def _suffixes() -> frozenset[str]:
    """The suffixes that OpenImageIO takes for images, in lower case."""
    groups = (group.partition(":") for group in oiio.get_string_attribute("extension_list").split(";"))
    return frozenset(
        f".{suffix}" for name, _, suffixes in groups if name not in _NOT_FILES for suffix in suffixes.split(",")
    )
