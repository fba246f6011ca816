"""Files compared as a whole: where they differ, pytest's own comparison looks for every difference, for hours."""

from pathlib import Path


def same_bytes(one: Path, other: Path | bytes) -> bool:
    """True where a file holds the same bytes as another file, or just these bytes."""
    return one.read_bytes() == (other if isinstance(other, bytes) else other.read_bytes())
