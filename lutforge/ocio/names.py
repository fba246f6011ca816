"""Names that OpenColorIO, file systems and archives all take."""

import hashlib
import re
import unicodedata
from collections.abc import Iterable

import PyOpenColorIO as OCIO  # noqa: N814 - the name that its documentation uses

_SIGNS = " ._()-"


def part_name(text: str, fallback: str = "unnamed") -> str:
    """One part of a name: letters and digits of any script, Latin ones without accents, and the signs . _ ( ) -.

    It has at most 64 characters: three of them must fit a menu and a file name.
    """
    return _cleaned(text)[:64].rstrip() or fallback


def _cleaned(text: str) -> str:
    kept: list[str] = []
    for sign in unicodedata.normalize("NFKD", text):
        if unicodedata.category(sign).startswith("M"):
            kept.append(sign if kept and not kept[-1].isascii() else "")
        else:
            kept.append(sign if sign in _SIGNS or sign.isalnum() else " ")
    words = unicodedata.normalize("NFC", "".join(kept)).split()
    return " ".join(words).lstrip("-. ")


def space_name(*parts: str) -> str:
    """A colour space, look or view name of parts that are names themselves."""
    return " ".join(filter(None, parts))


def file_stem(*parts: str) -> str:
    """A file name without suffix: lower case ASCII letters, digits and single underscores.

    Letters of other scripts become their code points, so that no name loses all of them; what is cut off, a digest.
    """
    text = _cleaned(" ".join(parts)).lower()
    ascii_only = "".join(sign if sign.isascii() else f"u{ord(sign):x}" for sign in text)
    stem = re.sub(r"[^a-z0-9]+", "_", ascii_only).strip("_") or "lut"
    if len(stem) <= 100:
        return stem
    digest = hashlib.sha256(stem.encode()).hexdigest()[:8]
    return f"{stem[:91].rstrip('_')}_{digest}"


class UniqueNames:
    """Hands out each name once, compared without case, as OpenColorIO does; a repeated one gets a number."""

    def __init__(self, taken: Iterable[str] = (), separator: str = " ") -> None:
        self._taken = {name.lower() for name in taken}
        self._separator = separator

    def __contains__(self, name: str) -> bool:
        return name.lower() in self._taken

    def __call__(self, name: str) -> str:
        """The name, or the name with the first number that makes it new."""
        candidate, number = name, 2
        while candidate in self:
            candidate, number = f"{name}{self._separator}{number}", number + 1
        self._taken.add(candidate.lower())
        return candidate


def config_names(config: OCIO.Config) -> set[str]:
    """Every name of a config that a colour space may not take, in lower case: spaces, named transforms, roles."""
    spaces = [*config.getColorSpaces(OCIO.SEARCH_REFERENCE_SPACE_ALL, OCIO.COLORSPACE_ALL)]
    spaces += [*config.getNamedTransforms(OCIO.NAMEDTRANSFORM_ALL)]
    names = [name for space in spaces for name in (space.getName(), *space.getAliases())]
    return {name.lower() for name in (*names, *config.getRoleNames())}
