"""Every exception that LutForge raises on purpose, in one tree, and the words of messages and notes.

The message is one line for the person who caused it: what is wrong, where (path, line, row), what to do.
The command line prints it and exits with status 2.
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
    """What an error says behind an unknown word: the names that are like it, and the known ones, as many as fit."""
    known = list(names)
    near = get_close_matches(word.lower(), known, cutoff=0.7)
    listed, others = ", ".join(known), 0
    if len(listed) > 300:
        listed = listed[:300].rpartition(", ")[0]
        others = len(known) - len(listed.split(", "))
    asked = f"did you mean {' or '.join(near)}? " if near else ""
    return f"{asked}known: {listed}{f' and {others} others' if others else ''}"


def in_common(notes: Iterable[tuple[str | Path, str]], what: str) -> Iterator[str]:
    """One line for each note, by the first that it is of and the number of those that share it.

    notes: pairs of a file, or a shot's name, and what there is to know of it; equal notes may differ in numbers and in
    the paths of their own files. what: they are, in the plural, such as "images".
    """
    alike: dict[str, list[tuple[str | Path, str]]] = {}
    for source, text in dict.fromkeys(notes):
        own = rf"[^\s:]*\b{re.escape(Path(source).stem)}\b[^\s:]*|[\d.]+"
        alike.setdefault(re.sub(own, "", text), []).append((source, text))
    for several in alike.values():
        source, text = several[0]
        yield f"{source}: {text}" if len(several) == 1 else f"{len(several)} {what}, such as {source}: {text}"


class SettingsError(LutForgeError):
    """A style, white balance or exposure selector that cannot be understood, or that the profile does not know."""


class ImageError(LutForgeError):
    """An image or RAW file that cannot be read or written."""


class ShotError(LutForgeError):
    """A RAW file that is not usable as a RAW/JPEG pair."""


class SampleError(LutForgeError):
    """A sample table that is malformed, or holds values that no camera can produce."""


class CalibrationError(LutForgeError):
    """Samples from which the wanted model cannot be fitted."""


class ProfileError(LutForgeError):
    """A camera profile that cannot be read, or does not hold what is asked of it."""


class LutError(LutForgeError):
    """A LUT that cannot be baked, written or read."""


class ConfigError(LutForgeError):
    """An OpenColorIO config that cannot be built or read."""
