"""Names that OpenColorIO, file systems and archives all take."""

import re
import unicodedata


def space_name(*parts: str) -> str:
    """A colour space, look or view name: ASCII words, free of OpenColorIO's own signs."""
    text = unicodedata.normalize("NFKD", " ".join(parts)).encode("ascii", "ignore").decode()
    return " ".join(re.sub(r"[^A-Za-z0-9 ._()-]", " ", text).split()).lstrip("-. ") or "camera"


def file_stem(*parts: str) -> str:
    """A file name without suffix: lower case, letters, digits and single underscores."""
    return re.sub(r"[^a-z0-9]+", "_", space_name(*parts).lower()).strip("_")[:100] or "lut"


class UniqueNames:
    """Hands out each name once, compared without case, as OpenColorIO does; a repeated one gets a number."""

    def __init__(self, taken: tuple[str, ...] = ()) -> None:
        self._taken = {name.lower() for name in taken}

    def __call__(self, name: str) -> str:
        """The name, or the name with the first number that makes it new."""
        candidate, number = name, 2
        while candidate.lower() in self._taken:
            candidate, number = f"{name} {number}", number + 1
        self._taken.add(candidate.lower())
        return candidate
