"""Tables of numbers in text with plain ASCII comments, as most LUT files are."""

import unicodedata
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from lutforge.arrays import Array
from lutforge.atomic_write import atomic_path

DIGITS = 6
"""Decimals of a number in a cube: an error of 5e-7, a thirtieth of a step of 16 bits."""

SHAPER_DIGITS = 9
"""Decimals of a number in a curve, whose error a steep cube after it magnifies."""


def rows_of_cube(values: Array) -> Array:
    """Node values (N, N, N, 3) as rows (n, 3) whose red index advances first."""
    return np.ascontiguousarray(values.transpose(2, 1, 0, 3)).reshape(-1, 3)


def rows(values: ArrayLike, digits: int = DIGITS) -> str:
    """Numbers (n, 3), a row per line, rounded to `digits` decimals, never "-0"; no reader has to know exponents."""
    numbers = np.round(np.asarray(values, dtype=np.float64), digits) + 0.0
    return (f"%.{digits}f %.{digits}f %.{digits}f\n" * len(numbers)) % tuple(numbers.ravel().tolist())


def comment_lines(title: str, comments: tuple[str, ...]) -> list[str]:
    """Title and comments as lines that begin with "# "; empty ones are left out."""
    return [f"# {plain(line)}" for line in (title, *comments) if plain(line)]


def plain(text: str, limit: int = 200) -> str:
    """One line of printable ASCII without double quotes, at most `limit` characters."""
    decomposed = unicodedata.normalize("NFKD", " ".join(text.split()).replace("Δ", "d"))
    bare = "".join(c for c in decomposed if not unicodedata.combining(c))
    return bare.replace('"', "'").encode("ascii", "replace").decode()[:limit]


def write_text(path: Path, text: str, encoding: str = "ascii") -> None:
    """Write a text file atomically, with line feeds on every system."""
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding=encoding, newline="\n")


def cube_of_rows(table: Array, size: int) -> Array:
    """Rows whose red index advances first → (N, N, N, 3)."""
    return np.ascontiguousarray(table.reshape(size, size, size, 3).transpose(2, 1, 0, 3))
