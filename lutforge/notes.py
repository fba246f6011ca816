"""Notes on many files: what several have in common is one line."""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path


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
