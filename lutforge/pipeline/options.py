"""Options that several use cases take."""

from collections.abc import Iterable
from typing import TypeVar

from lutforge.errors import SettingsError

Word = TypeVar("Word", bound=str)


def one_of(kind: str, word: str, choices: Iterable[Word]) -> Word:
    """Return the choice that a word names, whatever its case. Raises SettingsError, which lists the choices."""
    known = {choice.lower(): choice for choice in choices}
    if word.strip().lower() not in known:
        raise SettingsError(f'unknown {kind} "{word}"; choose {", ".join(known.values())}')
    return known[word.strip().lower()]
