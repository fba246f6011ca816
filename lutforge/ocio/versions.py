"""OpenColorIO profile versions: what a config loses where an older program is to read it."""

from lutforge.errors import ConfigError

OLDEST, NEWEST = 1, 6
DEFAULT_VERSION = "2.1"
"""Read by every OpenColorIO since 2021; newer ones add names, not colours."""
INTEROP_IDS = 5
"""First minor version with interop IDs."""
MIRRORED_DISPLAYS = 5
"""First minor version whose displays mirror negative values."""

_LOSSES = (
    (INTEROP_IDS, "no interop IDs (2.5): programs match the common spaces by their names and aliases"),
    (MIRRORED_DISPLAYS, "displays clamp negative values (mirrored from 2.5 on)"),
)


def minor_version(text: str) -> int:
    """Return the minor version: "2.4" → 4. Raises ConfigError on a version that is not 2.1 … 2.6."""
    major, dot, minor = text.strip().partition(".")
    if major != "2" or not dot or not minor.isdigit() or not OLDEST <= int(minor) <= NEWEST:
        raise ConfigError(f'OpenColorIO profile version "{text}": choose 2.{OLDEST} to 2.{NEWEST}')
    return int(minor)


def losses(minor: int) -> tuple[str, ...]:
    """What a config of this version lacks beside one of the newest, a line each."""
    return tuple(what for since, what in _LOSSES if minor < since)
