"""Which images a batch grades, and where each goes: files, folders and frame sequences."""

import os
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from pathlib import Path

import OpenImageIO as oiio  # noqa: N813 - the name that its documentation uses

from lutforge.errors import ImageError, SettingsError
from lutforge.images.heif import HEIF_SUFFIXES
from lutforge.shots.discover import RAW_SUFFIXES

JOURNAL = ".lutforge-apply.jsonl"
"""What a batch has done, in its output folder: one JSON object per line and graded image, the last one counts."""

_PATTERN = re.compile(
    r"(?P<head>.*?)(?P<frames>\d+-\d+(?:x\d+)?(?:,\d+(?:-\d+(?:x\d+)?)?)*)?(?P<pad>#+|@+|%0?\d*d)(?P<tail>[^#@%]*)"
)


@dataclass(frozen=True)
class Input:
    """An image to grade. place: its name, with the folders to keep, below the output folder."""

    path: Path
    place: Path


@dataclass(frozen=True)
class Failure:
    """An image that was not graded, and why, in one line."""

    source: Path
    reason: str


@dataclass(frozen=True)
class Inputs:
    """What the words of a command name.

    missing: frames that were asked for by number and are not there; notes: gaps in sequences, and what was left out.
    """

    images: tuple[Input, ...]
    missing: tuple[Failure, ...] = ()
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
    missing: list[Failure] = []
    notes: list[str] = []
    for word in map(Path, words):
        pattern = _PATTERN.fullmatch(word.name)
        if word.is_dir():
            in_folder, left_out = _in_folder(word, recursive, leave_out, raw)
            notes += left_out
            if not in_folder:
                deeper = "" if recursive else "; --recursive looks deeper"
                raise ImageError(f"{word}: no image in this folder{deeper}")
            images += in_folder
        elif pattern is None or word.exists():
            images.append(Input(word, Path(word.name)))
        elif (asked := frames or pattern["frames"]) is not None:
            for number in parse_frames(asked):
                path = word.with_name(f"{pattern['head']}{number:0{_digits(pattern['pad'])}d}{pattern['tail']}")
                if path.exists():
                    images.append(Input(path, Path(path.name)))
                else:
                    missing.append(Failure(path, f"{path}: this frame is missing"))
        else:
            numbered = _on_disk(word, pattern)
            images += [Input(path, Path(path.name)) for path in numbered.values()]
            gaps = [(before + 1, after - 1) for before, after in pairwise(numbered) if after - before > 1]
            if gaps:
                ranges = ", ".join(f"{first}" if first == last else f"{first}-{last}" for first, last in gaps)
                notes.append(f"{word}: not there: frame {ranges}")
    # A file that is named twice for one output is graded once; links with other names count as other images.
    first: dict[tuple[Path, Path], Input] = {}
    resolved = resolver()
    again = [each.path for each in images if first.setdefault((resolved(each.path), each.place), each) is not each]
    notes += [f"{path}: given twice; graded once" for path in dict.fromkeys(again)]
    return Inputs(tuple(first.values()), tuple(missing), tuple(notes))


def resolver() -> Callable[[Path], Path]:
    """A function that resolves paths as `Path.resolve`, but each folder once: it holds most of thousands of files."""
    folder = cache(Path.resolve)

    def resolved(path: Path) -> Path:
        linked = os.path.islink(path)  # noqa: PTH114 - Path.is_symlink raises where nothing may be read
        return path.resolve() if linked else folder(path.parent) / path.name

    return resolved


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


def _digits(pad: str) -> int:
    if pad.startswith("%"):
        return int(pad[1:-1] or 1)
    return 4 if pad == "#" else len(pad)


def _on_disk(word: Path, pattern: re.Match[str]) -> dict[int, Path]:
    """The frames of a sequence that exist, by number. Raises ImageError where there are none."""
    digits, numbered = _digits(pattern["pad"]), {}
    if not word.parent.is_dir():
        raise ImageError(f"{word.parent}: no such folder")
    frame = re.compile(f"{re.escape(pattern['head'])}([0-9]+){re.escape(pattern['tail'])}")
    for path in word.parent.iterdir():
        found = frame.fullmatch(path.name)
        if found and (len(found[1]) == digits or (len(found[1]) > digits and found[1][0] != "0")):
            numbered[int(found[1])] = path
    if not numbered:
        raise ImageError(f"{word}: no frame of this sequence is there")
    return dict(sorted(numbered.items()))


def is_picture(path: Path) -> bool:
    """Whether the suffix is that of an image file."""
    return path.suffix.lower() in _suffixes() | RAW_SUFFIXES


def _in_folder(folder: Path, recursive: bool, leave_out: Sequence[Path], raw: bool) -> tuple[list[Input], list[str]]:
    """The images of a folder by name, links to files among them, and notes on what was left out."""
    suffixes = _suffixes() | (RAW_SUFFIXES if raw else frozenset())
    excluded = {path.resolve() for path in leave_out}
    images: list[Input] = []
    notes: list[str] = []
    negatives = 0
    if excluded & {folder.resolve(), *folder.resolve().parents}:
        raise ImageError(f"{folder}: the graded images go into this folder; choose another output folder")

    def refuse(failure: OSError) -> None:
        reason = f"the folder cannot be read ({failure.strerror})"
        raise ImageError(f"{failure.filename}: {reason}; name the folders to grade")

    for place, subfolders, names in os.walk(folder, onerror=refuse):
        at = Path(place)
        paths = [at / name for name in sorted(names) if not name.startswith(".")]
        paths = [path for path in paths if path.suffix.lower() in suffixes]
        pictures = {path.stem.lower() for path in paths if path.suffix.lower() not in RAW_SUFFIXES}
        beside = {path for path in paths if path.suffix.lower() in RAW_SUFFIXES and path.stem.lower() in pictures}
        negatives += len(beside)
        images += [Input(path, path.relative_to(folder)) for path in paths if path not in beside]
        followed = [name for name in subfolders if recursive and not name.startswith(".")]
        followed = [name for name in followed if (at / name).resolve() not in excluded]
        # Path.exists raises where nothing may be read.
        graded = {name for name in followed if os.path.exists(at / name / JOURNAL)}  # noqa: PTH110
        subfolders[:] = [name for name in followed if name not in graded]
        filled = "left out, it was graded into; name it to grade what is in it"
        notes += [f"{at / name}: {filled}" for name in sorted(graded)]
    if negatives:
        files = f"{negatives} RAW file{'s' if negatives > 1 else ''}"
        notes.append(f"{folder}: {files} left out beside pictures of the same name; to render them, name them")
    return sorted(images, key=lambda image: image.path), notes


@cache
def _suffixes() -> frozenset[str]:
    """The suffixes of finished pictures, in lower case: OpenImageIO's, but for those that are no files, and HEIF's."""
    groups = (group.partition(":") for group in oiio.get_string_attribute("extension_list").split(";"))
    files = (suffixes.split(",") for name, _, suffixes in groups if name not in ("null", "term"))
    return frozenset(f".{suffix}" for suffixes in files for suffix in suffixes) | frozenset(HEIF_SUFFIXES)
