"""The exceptions that LutForge raises on purpose, and functions that format messages and notes.

A message is one line for the user: what is wrong, where (path, line, row), what to do. The command line prints it and
exits with status 2.
"""

import re
from collections.abc import Iterable, Iterator
from difflib import get_close_matches
from pathlib import Path


class LutForgeError(Exception):
    """The root of all errors that LutForge raises on purpose.

    The message is made one printable line of at most 500 characters, since it may quote names from a damaged file.
    """

    def __init__(self, message: str) -> None:
        super().__init__(one_line(message, 500))


def one_line(text: str, most: int = 300) -> str:
    """The text with single spaces, unprintable characters as "?", and its middle cut out where it is too long."""
    line = "".join(character if character.isprintable() else "?" for character in " ".join(text[:100_000].split()))
    if len(line) <= most:
        return line
    tail = most // 3
    return f"{line[: most - tail - 3].rstrip()} … {line[-tail:].lstrip()}"


def alternatives(word: str, names: Iterable[str]) -> str:
    """The end of a message on an unknown word: names that are similar to it, and the known names, as many as fit."""
    known = list(names)
    similar = get_close_matches(word.lower(), known, cutoff=0.7)
    listed = ", ".join(known)
    omitted = 0
    if len(listed) > 300:
        listed = listed[:300].rpartition(", ")[0]
        omitted = len(known) - len(listed.split(", "))
    question = f"did you mean {' or '.join(similar)}? " if similar else ""
    return f"{question}known: {listed}{f' and {omitted} others' if omitted else ''}"


def in_common(notes: Iterable[tuple[str | Path, str]], kind: str) -> Iterator[str]:
    """One line for all notes with the same text: the first file, and how many share it.

    notes: pairs of a file, or a shot's name, and a text; texts are the same where they differ only in numbers and in
    the path of the file. kind: of the files, in the plural, such as "images".
    """
    groups: dict[str, list[tuple[str | Path, str]]] = {}
    for source, text in dict.fromkeys(notes):
        path_or_number = rf"[^\s:]*\b{re.escape(Path(source).stem)}\b[^\s:]*|[\d.]+"
        groups.setdefault(re.sub(path_or_number, "", text), []).append((source, text))
    for group in groups.values():
        source, text = group[0]
        yield f"{source}: {text}" if len(group) == 1 else f"{len(group)} {kind}, such as {source}: {text}"


class SettingsError(LutForgeError):
    """A style, white balance or exposure selector that cannot be understood, or that the profile does not know."""


class ImageError(LutForgeError):
    """An image or RAW file that cannot be read or written."""


class ShotError(LutForgeError):
    """A RAW file that is not usable as a RAW/JPEG pair."""


class SampleError(LutForgeError):
    """A sample table that is malformed, or holds values that no camera can produce."""


class CalibrationError(LutForgeError):
    """Samples to which a model cannot be fitted."""


class ProfileError(LutForgeError):
    """A camera profile that cannot be read, or that lacks what a function needs."""


class LutError(LutForgeError):
    """A LUT that cannot be baked, written or read."""


class ConfigError(LutForgeError):
    """An OpenColorIO config that cannot be built or read."""
