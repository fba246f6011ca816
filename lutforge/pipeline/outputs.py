"""Checks of options and of outputs that several use cases share, done before the work."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from lutforge.atomic_write import require_writable
from lutforge.boundary import path_of
from lutforge.errors import LutForgeError, SettingsError, alternatives


def check_output(output: str | Path, suffixes: Sequence[str] = (), inputs: Iterable[str | Path] = ()) -> Path:
    """Return the path of an output that can be written.

    suffixes: those allowed, in lower case; empty for any. Raises LutForgeError where the suffix is another one, where
    the output is one of the inputs, or where no file can be written.
    """
    path = Path(output)
    require_writable(path)
    if suffixes and path.suffix.lower() not in suffixes:
        raise LutForgeError(f"{path}: this output is a {' or '.join(suffixes)} file; give its name that suffix")
    for source in map(Path, inputs):
        if path.resolve() == source.resolve() or (path.exists() and source.exists() and path.samefile(source)):
            raise LutForgeError(f"{path}: the output would replace an input; name another file")
    return path


def named_or_new(output: Path | None, default: str) -> Path:
    """Return the output if it is named, else the default. Raises LutForgeError where the default exists already."""
    if output is None and Path(default).exists():
        raise LutForgeError(f"{default}: there is one already; name the output, such as -o {default} to replace it")
    return Path(default) if output is None else output


Word = TypeVar("Word", bound=str)


def one_of(kind: str, word: str, choices: Iterable[Word]) -> Word:
    """Return the choice that a word names, in upper or lower case. Raises SettingsError, which lists the choices."""
    by_lower = {choice.lower(): choice for choice in choices}
    if str(word).strip().lower() not in by_lower:
        raise SettingsError(f'unknown {kind} "{word}"; {alternatives(str(word), by_lower.values())}')
    return by_lower[word.strip().lower()]


Paths = str | Path | Sequence[str | Path]


def several(paths: Paths) -> list[Path]:
    """Return one path, or several, as a list. Raises LutForgeError where an entry is no path."""
    return [
        path_of(path) for path in (paths if isinstance(paths, Sequence) and not isinstance(paths, str) else [paths])
    ]
