"""Options that several use cases take."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from lutforge.errors import SettingsError

Word = TypeVar("Word", bound=str)
Paths = str | Path | Sequence[str | Path]


def one_of(kind: str, word: str, choices: Iterable[Word]) -> Word:
    """Return the choice that a word names, whatever its case. Raises SettingsError, which lists the choices."""
    known = {choice.lower(): choice for choice in choices}
    if word.strip().lower() not in known:
        raise SettingsError(f'unknown {kind} "{word}"; choose {", ".join(known.values())}')
    return known[word.strip().lower()]


def several(paths: Paths) -> Sequence[str | Path]:
    """Return one path as a list of one, several as they are."""
    return [paths] if isinstance(paths, str | Path) else paths
