"""The lines that text LUT formats share: plain ASCII comments and fixed-point numbers."""

import unicodedata

import numpy as np
from numpy.typing import ArrayLike

DIGITS = 10
"""Decimals of a number: float32 values on [0, 1] survive, and no reader has to know exponents."""


def plain(text: str, limit: int = 200) -> str:
    """One line of printable ASCII without double quotes, at most `limit` characters."""
    decomposed = unicodedata.normalize("NFKD", " ".join(text.split()))
    kept = "".join(c for c in decomposed if not unicodedata.combining(c))
    return kept.replace('"', "'").encode("ascii", "replace").decode()[:limit]


def comment_lines(title: str, comments: tuple[str, ...]) -> list[str]:
    """Comment lines, each "# …"."""
    return [f"# {plain(line)}" for line in (title, *comments) if plain(line)]


def rows(values: ArrayLike) -> str:
    """Numbers (n, 3), a row per line, rounded to DIGITS decimals, never "-0"."""
    numbers = np.round(np.asarray(values, dtype=np.float64), DIGITS) + 0.0
    return (f"%.{DIGITS}f %.{DIGITS}f %.{DIGITS}f\n" * len(numbers)) % tuple(numbers.ravel().tolist())
